// Games that people of several kinds lose on the page, and the moment at which it says that each could still have been saved: one
// JSON object on standard input, another on standard output.
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { pathToFileURL } from "node:url";

const { site, levels: played } = JSON.parse(readFileSync(0, "utf8"));
globalThis.fetch = async (path) => new Response(readFileSync(join(site, path)));
const load = (name) => import(pathToFileURL(join(site, `${name}.js`)));
const [calls, game, hindsight, levels, { Match }, players, starts] = await Promise.all(
  ["calls", "game", "hindsight", "levels", "match", "players", "starts"].map(load),
);
const catalogue = JSON.parse(readFileSync(join(site, "catalogue.json"), "utf8"));
const HOLD = 5; // steps for which a person blunders

/** A person that sees late and blunders by chance, into no wall. */
async function personOf({ name, share_blunders: share }, role, random) {
  const player = await players.findPlayer(catalogue, `shielded:${name}`, role, "fair");
  let blunder = null;
  const act = (rules, state, who, states) => {
    if (state.steps % HOLD === 0) blunder = random() < share ? Math.floor(9 * random()) : null;
    const isSafe = blunder !== null && calls.canStop(rules, state, who, blunder);
    return isSafe ? blunder : player.act(rules, state, who, states);
  };
  return { name: "you", words: "you", values: null, act };
}

/** The captures among the games of one level, each with the page's answer; `milliseconds` of the processor. */
async function lostGames({ arena, difficulty, seconds, seed, number, most, people }) {
  const rules = levels.ofLevel(catalogue.games[arena], { seconds });
  const random = starts.makeRandom(seed);
  const persons = await Promise.all(people.map((person) => personOf(person, game.EVADER, random)));
  const pursuer = [await players.findPlayer(catalogue, `shielded:${players.ANYWHERE.pursuer}`, game.PURSUER, difficulty)];
  const match = new Match(rules, { pursuer, evader: [persons[0]] }, seed);
  const lost = [];
  while (lost.length < number && match.number <= most) {
    const kind = match.number % persons.length;
    match.players.evader = [persons[kind]];
    while (!match.isOver) match.step();
    if (match.outcome === "captured") lost.push(await lossOf(match, kind));
    match.next();
  }
  return { game: rules, played: match.number - 1, lost };
}

/** A game, and what the page says of it. */
async function lossOf(match, person) {
  const stand = await hindsight.standIn(catalogue, match, game.EVADER);
  const before = process.cpuUsage();
  const search = hindsight.lastChance(match, { role: game.EVADER, number: 0 }, stand);
  let [answer, steps] = [search.next(), 0];
  for (; !answer.done; steps++) answer = search.next();
  const { user, system } = process.cpuUsage(before);
  const replies = match.actions.map(([pursuer]) => pursuer);
  return { person, states: match.states.map(game.asRow), replies, moment: answer.value, steps, milliseconds: (user + system) / 1000 };
}

const all = [];
for (const level of played) all.push(await lostGames(level));
console.log(JSON.stringify(all));
