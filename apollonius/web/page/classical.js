// Players that follow a rule instead of a network. Each values the nine actions for one robot of a game.

import { valued } from "./observation.js";
import { EVADER, PURSUER } from "./rules.js";
import { countsOf } from "./teams.js";

const FOR_TEAMS = ["voronoi-pursuit", "encirclement"];
const NAMES = { [PURSUER]: ["pure-pursuit", "intercept", ...FOR_TEAMS], [EVADER]: ["flee", "flee-aware"] };
const TERRITORY = { [PURSUER]: "guard", [EVADER]: "reach" };

/** The players of one side by name: from (game, state, who) to the values of the nine actions. */
export const CLASSICAL = Object.fromEntries(
  Object.entries(NAMES).map(([side, names]) => {
    const functions = [...names.map((name) => [name, name.replace("-", "_")]), ["territory", TERRITORY[side]]];
    return [side, Object.fromEntries(functions.map(([name, rule]) => [name, (...seen) => valued(rule, FOR_TEAMS.includes(name), ...seen)]))];
  }),
);

/** Whether a rule can be followed in a game of so many robots. */
export function fits(name, game, [pursuers] = countsOf(game)) {
  if (FOR_TEAMS.includes(name)) return pursuers > 1;
  return name !== "territory" || Boolean(game.arena.territory);
}
