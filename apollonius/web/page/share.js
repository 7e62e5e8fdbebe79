// What a person can show to others of a game that is over: a picture with its trails, and a link that plays it again.

import { MOST_ROBOTS } from "./calls.js";
import { make } from "./files.js";
import { inFog } from "./fog.js";
import { HOLD, ROLES, asRow, bySide, countsOf, fromRow, inTeams, isContinuous, other } from "./game.js";
import { asFragment, fromFragment, gameFrom } from "./gamefile.js";
import { LEVELS } from "./levels.js";
import { Match } from "./match.js";
import { fromLists } from "./movers.js";
import { DIFFICULTIES } from "./players.js";
import { YOU, inWords } from "./words.js";

const MARK = "#replay=";
const CARD = { width: 1200, height: 630, margin: 40 }; // [pixels], as pages that show links cut pictures
const FILM = { side: 480, rate: 15 }; // the longer side [pixels], frames in a second

/** Return the fragment of a link to a finished game: its rules, level, how many play and whether in fog, its start, and what all did. */
export async function asReplayLink(match, level) {
  const { game: all, pursuer, evader, actions, movers } = match.replay();
  const { teams, sensors, ...game } = all;
  const counts = countsOf(all);
  if (game.arena.map) throw new Error("a game on a map is too large for a link: save the replay");
  if (JSON.stringify(inTeams(game, ...counts).teams) !== JSON.stringify(teams)) throw new Error("team mates differ: save the replay");
  const said = { game, counts, isFoggy: Boolean(sensors), pursuer, evader, actions, start: asRow(match.start), movers, level: level?.number };
  return asFragment(MARK, JSON.stringify(said));
}

/** Return the match that a link's fragment plays again, or null where it has none. Throws an Error in one line. */
export async function fromReplayLink(fragment) {
  try {
    const text = await fromFragment(MARK, fragment);
    return text === null ? null : again(JSON.parse(text));
  } catch {
    throw new Error("The link's game cannot be played again; copy the whole link");
  }
}

/** Return a match in which all robots do what they did. */
function again({ game: said, counts = [1, 1], isFoggy, start, movers, actions, level, ...names }) {
  if (!counts.every((count) => count >= 1 && count <= MOST_ROBOTS && count % 1 === 0)) throw new Error("other teams");
  const rules = inTeams(gameFrom(said), ...counts);
  const game = isFoggy ? inFog(rules) : rules;
  const isAction = (one) => (isContinuous(one) ? one.length === 2 && one.every(Number.isFinite) : one >= 0 && one <= 8 && one % 1 === 0);
  const players = bySide((role, side) => {
    const name = String(names[role]).slice(0, 60);
    const words = name === YOU ? "a person" : inWords(name.replace(/ \(.*/, ""));
    const act = (_game, _state, { number }, states) => actions[states.length - 1]?.[side * counts[0] + number] ?? HOLD;
    return Array(counts[side]).fill({ name: `${name} (again)`, words, act });
  });
  const robots = counts[0] + counts[1];
  if (!actions.every((all) => all.length === robots && all.every(isAction))) throw new Error("other actions");
  if (start.length !== 4 * robots || !start.every(Number.isFinite)) throw new Error("another start");
  const moving = game.movers && { movers: fromLists(game, movers) };
  const match = new Match(game, players, 0, { ...fromRow(game, start, 0, () => "active"), ...moving });
  match.next = match.again; // which has one start
  match.again();
  return Object.assign(match, { challenge: challengeOf(names, level, actions.length * game.dt) });
}

/** What a person can do better than the one whose game is played again: {choice, me, seconds}, or null where nobody steered alone. */
function challengeOf(names, number, seconds) {
  const people = ROLES.filter((role) => String(names[role]).startsWith(YOU));
  if (people.length !== 1) return null;
  const [me] = people;
  const [, name, difficulty] = /^(.*?)(?: \((\w+)\))?$/.exec(String(names[other(me)]).split("+")[0]);
  const level = LEVELS[number - 1] ?? null;
  const hardness = Object.hasOwn(DIFFICULTIES, difficulty) ? difficulty : "sharp";
  return { choice: { [me]: YOU, [other(me)]: name, difficulty: hardness, seed: 0, level }, me, seconds };
}

/** Return a film of what a canvas shows for some time [s], as small as a slow machine can keep up with. */
export function record(canvas, seconds) {
  if (!globalThis.MediaRecorder) throw new Error("this browser makes no films: save the replay");
  const scale = FILM.side / Math.max(canvas.width, canvas.height);
  const [width, height] = [canvas.width, canvas.height].map((side) => Math.round(scale * side));
  const frame = make("canvas", { width, height });
  const context = frame.getContext("2d");
  const recorder = new MediaRecorder(frame.captureStream(FILM.rate));
  const parts = [];
  recorder.addEventListener("dataavailable", ({ data }) => parts.push(data));
  recorder.start();
  setTimeout(() => recorder.stop(), 1000 * seconds);
  context.fillStyle = getComputedStyle(document.body).backgroundColor;
  const copy = () => {
    context.fillRect(0, 0, width, height);
    context.drawImage(canvas, 0, 0, width, height);
    if (recorder.state === "recording") requestAnimationFrame(copy);
  };
  copy();
  return new Promise((done) => recorder.addEventListener("stop", () => done(new Blob(parts, { type: recorder.mimeType }))));
}

/** Whether a page's address leads nowhere from other machines. */
export const isLocal = ({ protocol, hostname }) => protocol === "file:" || ["localhost", "127.0.0.1", "[::1]"].includes(hostname);

/** Return a picture of a game that is over: the arena as it is on a canvas, how it ended, and below that some lines. */
export function drawCard(canvas, said, below, colours) {
  const { width, height, margin } = CARD;
  const card = make("canvas", { width, height });
  const context = card.getContext("2d");
  const style = getComputedStyle(document.body);
  context.fillStyle = style.backgroundColor;
  context.fillRect(0, 0, width, height);
  const side = height - 2 * margin;
  const scale = Math.min(side / canvas.width, side / canvas.height);
  const [wide, high] = [scale * canvas.width, scale * canvas.height];
  context.drawImage(canvas, margin + (side - wide) / 2, (height - high) / 2, wide, high);
  context.fillStyle = colours.ink;
  context.font = `600 40px ${style.fontFamily}`;
  const left = 2 * margin + side;
  let line = "";
  let y = 3 * margin;
  for (const word of [...said.split(" "), null]) {
    if (word === null || context.measureText(line + word).width > width - margin - left) {
      context.fillText(line, left, y);
      [line, y] = ["", y + 52];
    }
    line += `${word} `;
  }
  context.font = `28px ${style.fontFamily}`;
  below.forEach((text, index) => context.fillText(text, left, height - (0.5 + below.length - index) * margin, width - margin - left));
  return new Promise((done) => card.toBlob(done, "image/png"));
}
