// How long the page takes to draw the chart of an arena, and to decide by it: `apollonius play --site DIR`, then
// `node benchmarks/charts.mjs DIR`. For each game of the page without a map one line: its chart [ms], the median, the
// 95th percentile and the longest of a decision [ms] by an untrained pursuer of the usual size, in 20 games against a
// random evader. Run it on an idle machine.
import { readFileSync } from "node:fs";
import { resolve } from "node:path";
import { pathToFileURL } from "node:url";

const folder = process.argv[2];
const load = (name) => import(pathToFileURL(resolve(folder, name)));
const [{ BUILT_IN, atBest }, { chartOf }, { Match }] = await Promise.all(
  ["agents.js", "charting.js", "match.js"].map(load),
);
const { games, maps } = JSON.parse(readFileSync(resolve(folder, "catalogue.json"), "utf8"));
const SIZES = [92, 256, 256, 256, 256, 9];
const GAMES = 20;

const numbers = (count, size) => Float32Array.from({ length: count }, () => size * (Math.random() - 0.5));
const layers = SIZES.slice(1).map((size, index) => {
  return { weight: numbers(size * SIZES[index], 4 / Math.sqrt(SIZES[index])), bias: numbers(size, 0.1) };
});
const decide = atBest({ header: { observation: "egocentric" }, layers });

for (const [name, game] of Object.entries(games)) {
  if (maps[name]) continue;
  const begun = performance.now();
  chartOf(game);
  const chart = performance.now() - begun;
  const decisions = [];
  const act = (...seen) => {
    const begun = performance.now();
    const [action] = decide(...seen);
    decisions.push(performance.now() - begun);
    return action;
  };
  const match = new Match(game, { pursuer: { act }, evader: { act: () => BUILT_IN.random()[0] } }, 0);
  for (; match.number <= GAMES; match.next()) while (!match.isOver) match.step();
  decisions.sort((a, b) => a - b);
  const [median, high, most] = [0.5, 0.95, 1].map((share) => decisions[Math.ceil(share * decisions.length) - 1]);
  const shown = { chart, median, p95: high, longest: most };
  const text = Object.entries(shown).map(([what, milliseconds]) => `${what} ${milliseconds.toFixed(2)}`);
  console.log(`${name}: ${text.join(", ")} (${decisions.length} decisions)`);
}
