// What one robot sees, as the package's functions read it.

import { STOPS, placesOf } from "./chart.js";
import { chartOf } from "./charting.js";
import { handArena, handChart, handRobots } from "./handing.js";
import { run } from "./programs.js";
import { other } from "./rules.js";
import { isActive } from "./teams.js";

const CHARTED = ["egocentric", "team"]; // observations that are made of a chart
const EVERYWHERE = Array.from({ length: STOPS ** 2 }, (_, stop) => stop);

/** Hand over what one robot, {role, number}, sees. */
function handView(game, state, { role, number }) {
  handArena(game.arena);
  handRobots(game, state, [role, other(role)], number);
}

/** The numbers of an observation, by its name, for what one robot sees. */
export function observe(name, game, state, who) {
  if (CHARTED.includes(name)) {
    const chart = chartOf(game);
    const robots = [...state.pursuer, ...state.evader].filter(isActive);
    handChart(chart, robots.flatMap(({ x, y }) => placesOf(chart, x, y).stops));
  }
  handView(game, state, who);
  return [...run[`see_${name}`](game.capture_distance)];
}

/** The values of the nine actions to one who follows a rule, by the name of its function; some need ways from everywhere. */
export function valued(rule, needsWays, game, state, who) {
  if (needsWays) handChart(chartOf(game), EVERYWHERE);
  handView(game, state, who);
  return [...run[rule](game.capture_distance, game.dt)];
}
