// Games, states and charts as the functions of `programs.js` read them. What was handed over last stays there, so that an
// arena or a chart is copied once and not for every call.

import { addresses, given, kept } from "./programs.js";
import { bodiesOf } from "./teams.js";

export const STATUSES = ["active", "captured", "hit_obstacle", "out_of_range", "hit_mate"];
export const MOST_ROBOTS = given.robots().status.length / 2; // of a side
const BODY = ["v_min", "v_max", "u1_max", "u2_max", "radius"];
const ROBOT = ["x", "y", "v", "heading"];
const fields = new WeakMap(); // addresses of maps' fields
let [floor, chart] = [null, null]; // what was handed over last
let rows = new Set(); // stops whose ways were, of that chart

/** The arena. */
export function handArena(arena) {
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

/** The edges of a polygon in single precision: where each begins, the way to its end, 1 if it runs counter-clockwise. */
function edgesOf({ vertices }) {
  const corners = vertices.map((corner) => corner.map(Math.fround));
  const next = (index) => corners[(index + 1) % corners.length];
  const area = corners.reduce((sum, [x, y], index) => sum + x * next(index)[1] - next(index)[0] * y, 0);
  return corners.map(([x, y], index) => ({ x, y, along_x: next(index)[0] - x, along_y: next(index)[1] - y, turn: area > 0 ? 1 : -1 }));
}

/** One robot that moves: its body, and where it is. */
export function handRobot(body, robot) {
  const [limits, state] = [given.body(), given.robot()];
  for (const key of BODY) limits[key][0] = body[key];
  for (const key of ROBOT) state[key][0] = robot[key];
}

/**
 * The robots of a state, a side's first.
 *
 * @param roles the side whose robots come first, and the other one
 * @param number which of them is the very first
 */
export function handRobots(game, state, roles, number = 0) {
  const into = given.robots();
  into.status.fill(STATUSES.indexOf("captured"));
  roles.forEach((role, side) => {
    const bodies = bodiesOf(game, role);
    state[role].forEach((robot, index) => {
      const turned = side || index > number ? index : index === number ? 0 : index + 1;
      const place = side * MOST_ROBOTS + turned;
      for (const key of BODY) into[`bodies_${key}`][place] = bodies[index][key];
      for (const key of ROBOT) into[`states_${key}`][place] = robot[key];
      into.status[place] = STATUSES.indexOf(robot.status);
    });
  });
}

/** A chart, with the ways from some stops. */
export function handChart(wanted, stops) {
  const into = given.chart();
  if (chart !== wanted) {
    [chart, rows] = [wanted, new Set()];
    into.field.set(wanted.field);
    into.beside.set(wanted.beside);
    for (const key of ["x", "y", "side"]) into[key][0] = wanted[key];
  }
  for (const stop of stops) {
    if (rows.has(stop)) continue;
    rows.add(stop);
    const lengths = wanted.ways.from(stop);
    into.ways.set(lengths, stop * lengths.length);
  }
}
