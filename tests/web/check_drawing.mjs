// Answers questions about arenas drawn on the page: a JSON object on standard input, another on standard output.
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const { page, fuzz, read = [], surveys = [], map, links, moves } = JSON.parse(readFileSync(0, "utf8"));
const load = (name) => import(pathToFileURL(`${page}/${name}`));
const [plan, { gameFrom, DEFAULT }, file, { survey }, { mapOf }, { makeRandom }] = await Promise.all(
  ["plan.js", "validation.js", "gamefile.js", "survey.js", "mapfile.js", "rules.js"].map(load),
);

/** What comes of a question, or the complaint. */
const tried = (work) => {
  try {
    return { answer: work() };
  } catch (error) {
    return { complaint: error.message };
  }
};

/** A game as somebody in a hurry would draw it: three discs, and eleven walls and blocks. */
function drawn(random) {
  const within = (low, high) => low + (high - low) * random();
  let game = plan.withSize(plan.cleared(gameFrom({})), Math.round(within(8, 20)), Math.round(within(8, 20)));
  const { x_max: width, y_max: height } = game.arena;
  const place = (room = 0) => plan.snapped([within(room, width - room), within(room, height - room)]);
  const around = ([x, y], far) => plan.snapped([x + within(-far, far), y + within(-far, far)]);
  for (let disc = 0; disc < 3; disc++) game = plan.withDisc(game, place(), within(0.1, 0.8));
  const room = place(2);
  game = plan.withRoom(game, room, plan.snapped([room[0] + within(2, 5), room[1] + within(2, 5)]));
  const corridor = place(2);
  game = plan.withCorridor(game, corridor, around(corridor, 3));
  const wall = place(1);
  const end = around(wall, 3);
  game = plan.withWall(game, wall, end);
  game = plan.withDoor(game, [(wall[0] + end[0]) / 2, (wall[1] + end[1]) / 2]);
  for (let block = 0; block < 2; block++) {
    const corner = place();
    game = plan.withBlock(game, corner, around(corner, 2));
  }
  for (let change = 0; change < 6; change++) {
    const [kind, far] = [random() < 0.3 ? "discs" : "polygons", [within(-2, 2), within(-2, 2)]];
    const shape = { kind, index: Math.floor(random() * game.arena[kind].length) };
    game = plan.moved(game, shape, plan.snapped(far));
    const grips = plan.handles(game, shape).grips;
    const grip = Math.floor(random() * grips.length);
    game = plan.resized(game, shape, grip, around(grips[grip], 0.5));
  }
  const body = () => ({ ...DEFAULT.pursuer, v_max: within(0.5, 2), u1_max: within(0.1, 1), u2_max: within(0.2, 2), radius: within(0, 0.25) });
  return gameFrom({ ...game, pursuer: body(), evader: body(), capture_distance: within(0.2, 0.6) });
}

const answer = {};
if (fuzz) {
  answer.fuzz = [];
  for (let seed = fuzz.seed; answer.fuzz.length < fuzz.count; seed++) {
    const { answer: game } = tried(() => drawn(makeRandom(seed)));
    if (game?.arena.polygons.length !== 11) continue; // some shapes come to nothing
    const linked = file.fromFragment(file.asFragment(game));
    answer.fuzz.push({ game, file: file.writeGame(game), isSame: JSON.stringify(linked) === JSON.stringify(game) });
  }
}
answer.read = read.map((text) => tried(() => file.readGame(text)));
answer.surveys = surveys.map((game) => {
  const { wrong, notes } = survey(game);
  return { wrong, notes };
});
if (map) {
  const [yaml, image] = map.map((path) => ({ name: path.split("/").pop(), bytes: new Uint8Array(readFileSync(path)) }));
  const found = await mapOf(yaml, image).catch((error) => ({ complaint: error.message }));
  answer.map = { ...found, field: [...(found.field ?? [])] };
}
if (links) {
  const random = makeRandom(links.seed);
  const [whole] = answer.fuzz ?? [{ game: gameFrom({}) }];
  const fragment = file.asFragment(whole.game);
  const text = file.writeGame(whole.game);
  const asLink = (text) => `#game=${Buffer.from(text, "latin1").toString("base64url")}`;
  const changed = (letters) => {
    const [at, length] = [Math.floor(random() * letters.length), Math.floor(random() * 9)];
    const noise = Array.from({ length: Math.floor(random() * 9) }, () => String.fromCharCode(Math.floor(random() * 256))).join("");
    return letters.slice(0, at) + noise + letters.slice(at + length);
  };
  answer.links = Array.from({ length: links.count }, (_, index) => {
    const { answer: game, complaint } = tried(() => file.fromFragment(index % 2 ? changed(fragment) : asLink(changed(text))));
    return complaint ?? (game ? "played" : "none");
  });
}
if (moves) {
  const random = makeRandom(moves);
  let game = gameFrom({ arena: { x_max: 9, y_max: 7 } });
  game = plan.withWall(game, [1, 1], [6, 1]);
  const door = plan.withDoor(game, [3, 1.05]).arena.polygons.map(({ vertices }) => vertices);
  const room = plan.withRoom(game, [2, 2], [6, 6]).arena.polygons.length - 1;
  const far = plan.moved(game, { kind: "polygons", index: 0 }, [100, -100]).arena.polygons[0].vertices;
  const crossed = plan.resized(game, { kind: "polygons", index: 0 }, 0, [8, 5]).arena.polygons[0].vertices;
  const small = plan.withSize(plan.withDisc(game, [8, 6], 0.5), 7, 7).arena.discs.length;
  const nothing = plan.withBlock(game, [2, 3], [2, 5]) === game;
  answer.moves = { door, nothing, room, far, crossed, small, random: random() };
}
console.log(JSON.stringify(answer));
