// The package's functions (`programs.js`) as the page calls them: steps, clearances, charts, observations, players' values.
//
// What was written to their memory last stays there, so that an arena or a chart is copied once and not for every call.

import { ACTIONS, EVADER, OUTCOMES, PURSUER, ROLES, STATUSES, actionLevels, bodiesOf, bodyOf, bySide, isActive, other, robotOf } from "./game.js";
import { asLists, fromLists, writeDraws, writeMovers } from "./movers.js";
import { addresses, given, kept, ownProgram, run } from "./programs.js";

export const MOST_ROBOTS = given.robots().status.length / 2; // of a side
const FINE = Math.sqrt(given.chart().visible.length); // cells of a chart's clearances along the arena's longer side
export const CELLS = Math.sqrt(Math.sqrt(given.chart().lengths.length)); // cells along it between which paths are known
const MARGIN = 1e-3; // clearance [m] that the shield wants
export const CHARTED = ["egocentric", "team", "voronoi_pursuit", "encirclement", "own", "search", "departure_costs"]; // what reads a chart
const BODY = Object.keys(given.robots()).flatMap((key) => key.match(/(?<=^bodies_).*/) ?? []); // limits of a robot
const ROBOT = ["x", "y", "v", "heading"];
const FAR = 1e6; // where robots are that a game does not have [m]
const fields = new WeakMap(); // addresses of maps' fields
let floor = null; // the arena that was written last
let charted = { arena: null, radius: 0 }; // the arena and the robot that the chart is of

function writeArena(arena) {
  if (floor === arena) return;
  floor = arena;
  const { x_min, x_max, y_min, y_max, discs, polygons = [], map, territory = { x: 0, y: 0, radius: 0 } } = arena;
  const into = given.floor();
  into.walls.set([x_min, x_max, y_min, y_max]);
  for (const key of ["x", "y", "radius"]) {
    into[`territory_${key}`][0] = territory[key];
    discs.forEach((disc, index) => (into[`discs_${key}`][index] = disc[key]));
  }
  const edges = polygons.flatMap(edgesOf);
  for (const key of ["x", "y", "along_x", "along_y", "turn"]) edges.forEach((edge, index) => (into[`edges_${key}`][index] = edge[key]));
  into.counts.set([discs.length, edges.length, map?.rows ?? 0, map?.columns ?? 0]);
  if (!map) return;
  into.map.set([map.x, map.y, map.cell]);
  if (!fields.has(map.field)) fields.set(map.field, kept([map.field]));
  addresses.field = fields.get(map.field);
}

/** The edges of a polygon in single precision: where each begins, the vector to its end, 1 if it runs counter-clockwise. */
function edgesOf({ vertices }) {
  const corners = vertices.map((corner) => corner.map(Math.fround));
  const next = (index) => corners[(index + 1) % corners.length];
  const area = corners.reduce((sum, [x, y], index) => sum + x * next(index)[1] - next(index)[0] * y, 0);
  return corners.map(([x, y], index) => ({ x, y, along_x: next(index)[0] - x, along_y: next(index)[1] - y, turn: area > 0 ? 1 : -1 }));
}

function writeRobot(place, body, robot) {
  const into = given.robots();
  for (const key of BODY) into[`bodies_${key}`][place] = body[key] ?? 0;
  for (const key of ROBOT) into[`states_${key}`][place] = robot[key];
}

/** Write the robots of a state: those of the first of two roles first, and the one of a number before its team mates. */
function writeRobots(game, state, roles, number = 0) {
  const { status, states_x } = given.robots();
  status.fill(STATUSES.indexOf("captured"));
  states_x.fill(FAR);
  roles.forEach((role, side) => {
    const bodies = bodiesOf(game, role);
    state[role].forEach((robot, index) => {
      const turned = side || index > number ? index : index === number ? 0 : index + 1;
      const place = side * MOST_ROBOTS + turned;
      writeRobot(place, bodies[index], robot);
      status[place] = STATUSES.indexOf(robot.status);
    });
  });
}

/** A copy of a record's arrays. */
const copied = (record) => Object.fromEntries(Object.entries(record).map(([key, values]) => [key, values.slice()]));

/** Draw the chart of a game's arena, by the paths of its largest robot, if it is not the one that was drawn last. */
function writeChart(game) {
  const { arena } = game;
  const radius = Math.max(...ROLES.flatMap((role) => bodiesOf(game, role).map((body) => body.radius)));
  if (charted.arena === arena && charted.radius === radius) return;
  charted = { arena, radius };
  writeArena(arena);
  const side = Math.max(arena.x_max - arena.x_min, arena.y_max - arena.y_min);
  const along = (low) => Array.from({ length: FINE + 1 }, (_, corner) => Math.fround(low) + Math.fround(corner * (side / FINE)));
  given.corners().set([...along(arena.x_min), ...along(arena.y_min)]);
  run.chart(side, radius);
}

/** The robot after holding an action for `dt` [s] (Eq. 1). */
export function move(body, robot, action, dt) {
  writeRobot(0, body, robot);
  given.levels().set(actionLevels(action));
  const { x, y, v, heading } = run.move(dt);
  return { x: x[0], y: y[0], v: v[0], heading: heading[0] };
}

/**
 * One transition: all robots hold their actions for `dt`, and those that are not in play stand still.
 *
 * @param actions {pursuer, evader}: of each robot of either side
 * @returns {state, outcome}
 */
export function step(game, state, actions) {
  writeArena(game.arena);
  writeMovers(game, state);
  writeRobots(game, state, ROLES);
  ROLES.forEach((role, side) => {
    state[role].forEach((robot, index) => given.levels().set(isActive(robot) ? actionLevels(actions[role][index]) : [0, 0], 2 * (side * MOST_ROBOTS + index)));
  });
  const found = run.step_robots(game.capture_distance, game.dt, state.steps, game.max_steps);
  const { x, y, v, heading } = found.states();
  const [status, [outcome]] = [found.status(), found.outcome()];
  const robot = (at) => ({ x: x[at], y: y[at], v: v[at], heading: heading[at], status: STATUSES[status[at]] });
  const after = bySide((role, side) => state[role].map((_, index) => robot(side * MOST_ROBOTS + index)));
  const movers = state.movers && { movers: copied(found.movers_after()) };
  return { state: { ...after, ...movers, steps: state.steps + 1 }, outcome: OUTCOMES[outcome] };
}

/** The time in which a mover covers a length [m] from rest to rest [s], by its top speed and largest acceleration. */
export const timeOfLeg = (...limits) => run.duration(...limits)[0];

/** The movers of a game at the start, each where the first of several places [x, y] of a walker, or times, leaves robots their room. */
export function startMovers(game, state, places, random) {
  writeMovers(game, state);
  writeRobots(game, state, ROLES);
  writeDraws(places, random);
  return fromLists(game, asLists(game, run.start_movers(game.starts.clearance, game.dt).movers_after()));
}

/** Distance [m] from a point to the nearest wall or obstacle; negative outside the walls or inside an obstacle. */
export function clearance(arena, x, y) {
  writeArena(arena);
  return run.clearance(x, y)[0];
}

/** Least clearance [m] on the segment between two states of a robot. */
export function clearanceAlong(arena, before, after) {
  writeArena(arena);
  for (const key of ["x", "y"]) given.robots()[`states_${key}`].set([before[key], after[key]]);
  return run.clearance_along()[0];
}

/** Least clearance [m] during an action and the best of three ways to brake to rest after it; less where it is ample. */
export function clearanceAfter(game, state, who, action) {
  writeArena(game.arena);
  writeMovers(game, state);
  writeRobot(0, bodyOf(game, who), robotOf(state, who));
  given.levels().set(actionLevels(action));
  return run.clearance_after(game.dt)[0];
}

/** Return whether the shield allows an action. */
export const canStop = (...asked) => clearanceAfter(...asked) > MARGIN;

/** Write what one robot, {role, number}, sees. */
function writeView(name, game, state, { role, number }) {
  if (CHARTED.includes(name)) writeChart(game);
  writeArena(game.arena);
  writeMovers(game, state);
  writeRobots(game, state, [role, other(role)], number);
}

/** What one robot sees as numbers: an observation, a rule's values of the nine actions, or their costs, by a program's name. */
export function observe(name, game, state, who) {
  writeView(name, game, state, who);
  return [...run[name](game.capture_distance, game.dt)];
}

/**
 * What a robot knows of its one opponent after a look at a state, and where a pursuer seeks it.
 *
 * @param before what it knew before; nothing at the beginning of a game
 * @returns {known, last, age [s], isSeen, budget, sought}: all that it knows; of it the last sighting, its age, whether there was
 *   one, and in which cells of the chart the opponent can be, where 0 or more; and the opponent as a pursuer seeks it
 */
export function search(game, state, who, before) {
  writeView("search", game, state, who);
  const into = given.searcher();
  if (before) for (const key of Object.keys(into)) into[key].set(before.known[key]);
  else into.track_ages_0[0] = -1;
  given.shares().set(Array.from({ length: CELLS ** 2 }, Math.random));
  const found = run.search(game.capture_distance, game.dt);
  const known = copied(found.after());
  const last = Object.fromEntries(ROBOT.map((key) => [key, known[`track_opponents_0_${key}`][0]]));
  const sought = Object.fromEntries(Object.entries(found.sought()).map(([key, [value]]) => [key, value]));
  const [isSeen] = found.sight();
  return { known, last, age: known.track_ages_0[0], isSeen, budget: known.track_belief_travel_budget, sought };
}

const rule = (program) => (...seen) => observe(program, ...seen);
const FOR_TEAMS = { "voronoi-pursuit": rule("voronoi_pursuit"), encirclement: rule("encirclement") };
/** Players of one side that follow a rule, by name: from (game, state, who) to the values of the nine actions. */
export const CLASSICAL = {
  [PURSUER]: { "pure-pursuit": rule("pure_pursuit"), intercept: rule("intercept"), ...FOR_TEAMS, territory: rule("guard") },
  [EVADER]: { flee: rule("flee"), "flee-aware": rule("flee_aware"), territory: rule("reach") },
};

/**
 * Which side is first at each cell of a game's chart, row by row from the bottom: seconds by which an evader is earlier than any
 * pursuer's reach; NaN where no path leads, or one side is out of play.
 */
export function leads(game, state) {
  writeChart(game);
  writeRobots(game, state, ROLES);
  return run.arrival_advantage(game.capture_distance);
}

/** A player of a user's own, from the bytes of its module. */
export function readOwn(buffer) {
  const act = ownProgram(buffer);
  const player = (game, ...seen) => {
    writeView("own", game, ...seen);
    return [act(game.capture_distance, game.dt)[0], ...ACTIONS];
  };
  return { player, values: null };
}

/** Return whether a rule can be followed in a game with a number of pursuers. */
export function fits(name, game, pursuers) {
  if (name in FOR_TEAMS) return pursuers > 1;
  return name !== "territory" || Boolean(game.arena.territory);
}
