// Games from elsewhere, a file or a link: what is left out has its default, and what cannot be played is refused with the
// value, the bound and the remedy, as `arenas/record.py` and `game/validation.py` do.

import { clearance } from "./clearance.js";
import { makeRandom } from "./rules.js";

const MAX_TURN = 2; // in one step [rad]
const MAX_SIZE = 1e6; // of any number
const MAX_STEPS = 2 ** 31 - 1;
const [MOST_DISCS, MOST_POLYGONS, MOST_CORNERS, MOST_EDGES] = [250, 200, 1000, 2000];
const DRAWS = 20_000; // pairs of places at which room to start is looked for
const APART = 1e-6; // what is nearer [m] touches
const SHORTEST = 0.01; // step [s] that the page keeps up with
const LONGEST_STOP = 1000; // steps that a robot may take to stop, as shields look so far ahead

const BODY = { v_min: 0, v_max: 1.2, u1_max: 0.3, u2_max: 0.8, radius: 0 };
/** A game with nothing said: the paper's, without discs. */
export const DEFAULT = {
  pursuer: BODY,
  evader: BODY,
  arena: { x_min: 0, x_max: 10, y_min: 0, y_max: 10, discs: [], polygons: [] },
  capture_distance: 0.3,
  dt: 0.1,
  max_steps: 1000,
  reward: { profile: "paper", capture: 10, failure: 10, progress: 3 },
  starts: { speed: "rest", clearance: 0.3, separation: 1 },
};
const DISC = { x: null, y: null, radius: null };
const OPTIONAL = { reward: ["zero_sum_within"], arena: ["territory", "map"] };

function require(isPossible, name, value, bound) {
  if (!isPossible) throw new Error(`${name} = ${shown(value)} is not possible: it must be ${bound}`);
}

/** A value in a message, however large or strange it is. */
function shown(value) {
  const text = typeof value === "string" ? value : (JSON.stringify(value) ?? String(value));
  return text.length > 60 ? `${text.slice(0, 60)}…` : text;
}

const isTable = (value) => value !== null && typeof value === "object" && !Array.isArray(value);

/** A table by its defaults: each key known, each value of the default's kind. */
function filled(said, defaults, name, optional = []) {
  require(isTable(said), name, said, "a table of keys and values");
  for (const key of Object.keys(said)) {
    const isKnown = Object.hasOwn(defaults, key) || optional.includes(key);
    if (!isKnown) throw new Error(`${name}: '${shown(key)}' is no known key: remove it`);
  }
  const made = {};
  for (const [key, usual] of Object.entries(defaults)) {
    const value = Object.hasOwn(said, key) ? said[key] : usual;
    if (usual === null || typeof usual === "number") {
      require(Number.isFinite(value) && typeof value === "number", `${name}.${key}`, value, "a finite number");
      require(Math.abs(value) <= MAX_SIZE || key === "max_steps", `${name}.${key}`, value, `within ${MAX_SIZE} of 0`);
    }
    made[key] = value;
  }
  return made;
}

function list(value, name, most) {
  require(Array.isArray(value), name, value, "a list");
  require(value.length <= most, name, `${value.length} of them`, `at most ${most}; draw so many obstacles as an occupancy map`);
  return value;
}

/**
 * A game from what a file or link says.
 *
 * @param said nested tables, as of a JSON file
 * @param map {x, y, cell, rows, columns, field, file, digest} of the map it names, if it does
 * @throws Error in one line
 */
export function gameFrom(said, map = null) {
  const { arena: saidArena = {}, pursuer = {}, evader = {}, reward = {}, starts = {}, ...rest } = filledTables(said);
  const { pursuer: _p, evader: _e, arena: _a, reward: _r, starts: _s, ...numbers } = DEFAULT;
  const ends = map && { x_min: map.x, x_max: map.x + (map.columns - 1) * map.cell, y_min: map.y, y_max: map.y + (map.rows - 1) * map.cell };
  const game = {
    ...filled(rest, numbers, "game"),
    pursuer: filled(pursuer, BODY, "pursuer"),
    evader: filled(evader, BODY, "evader"),
    arena: arenaFrom(saidArena, { ...DEFAULT.arena, ...ends }),
    reward: rewardFrom(reward),
    starts: filled(starts, DEFAULT.starts, "starts"),
  };
  if (map) game.arena.map = map;
  check(game, ends);
  return game;
}

function filledTables(said) {
  require(isTable(said), "game", said, "a table of keys and values");
  require(!Object.hasOwn(said, "scenario"), "scenario", said.scenario, "left out, as the page plays in one arena");
  for (const key of ["pursuers", "evaders", "teams", "mates_collide"]) {
    require(!Object.hasOwn(said, key), key, said[key], "left out here: how many robots there are is chosen under Games");
  }
  return said;
}

function arenaFrom(said, defaults) {
  const arena = filled(said, defaults, "arena", OPTIONAL.arena);
  arena.discs = list(arena.discs, "arena.discs", MOST_DISCS).map((disc, i) => filled(disc, DISC, `arena.discs[${i}]`));
  arena.polygons = list(arena.polygons, "arena.polygons", MOST_POLYGONS).map((polygon, i) => {
    const { vertices } = filled(polygon, { vertices: [] }, `arena.polygons[${i}]`);
    const name = `arena.polygons[${i}].vertices`;
    for (const corner of list(vertices, name, MOST_CORNERS)) {
      const isPlace = Array.isArray(corner) && corner.length === 2 && corner.every((one) => Number.isFinite(one) && Math.abs(one) <= MAX_SIZE);
      require(isPlace, name, corner, "[x, y] of each corner");
    }
    return { vertices: vertices.map(([x, y]) => [x, y]) };
  });
  if (said.territory !== undefined) arena.territory = filled(said.territory, DISC, "arena.territory");
  return arena;
}

function rewardFrom(said) {
  const reward = filled(said, DEFAULT.reward, "reward", OPTIONAL.reward);
  const within = said.zero_sum_within;
  if (within === undefined) return reward;
  require(Number.isFinite(within) && within > 0 && within <= MAX_SIZE, "reward.zero_sum_within", within, "more than 0 m");
  return { ...reward, zero_sum_within: within };
}

function check(game, ends) {
  const { dt, capture_distance: capture, max_steps: steps, starts, arena, reward } = game;
  require(["paper", "zero-sum"].includes(reward.profile), "reward.profile", reward.profile, "paper or zero-sum");
  require(["rest", "moving"].includes(starts.speed), "starts.speed", starts.speed, "rest or moving");
  require(dt >= SHORTEST, "dt", dt, `at least ${SHORTEST} s, which the page keeps up with`);
  require(Math.fround(capture) > 0, "capture_distance", capture, "more than 0 m");
  require(Number.isInteger(steps) && steps >= 1 && steps <= MAX_STEPS, "max_steps", steps, "a whole number, at least 1");
  for (const side of ["pursuer", "evader"]) checkBody(game[side], side, dt);
  checkArena(arena, ends);
  require(starts.clearance >= 0, "starts.clearance", starts.clearance, "0 m or more");
  require(starts.separation >= capture, "starts.separation", starts.separation, `at least capture_distance = ${capture} m`);
  checkRoom(game);
}

function checkBody(body, name, dt) {
  require(body.v_min <= body.v_max, `${name}.v_min`, body.v_min, `at most v_max = ${body.v_max} m/s`);
  require(body.v_max > 0, `${name}.v_max`, body.v_max, "more than 0 m/s");
  require(body.u1_max >= 0, `${name}.u1_max`, body.u1_max, "0 m/s^2 or more");
  require(body.u2_max >= 0, `${name}.u2_max`, body.u2_max, "0 rad/s or more");
  require(body.u2_max * dt <= MAX_TURN, `${name}.u2_max`, body.u2_max, `at most ${MAX_TURN} rad in a step`);
  require(body.radius >= 0, `${name}.radius`, body.radius, "0 m (a point) or more");
  // What only the page demands, as it plays at the clock's pace.
  const stops = body.v_max <= LONGEST_STOP * body.u1_max * dt;
  require(stops, `${name}.u1_max`, body.u1_max, `enough to stop from v_max = ${body.v_max} m/s within ${LONGEST_STOP} steps`);
}

function checkArena(arena, ends) {
  const { x_min: left, x_max: right, y_min: low, y_max: high } = arena;
  require(left < right, "arena.x_min", left, `less than x_max = ${right} m`);
  require(low < high, "arena.y_min", low, `less than y_max = ${high} m`);
  const inside = (x, y) => left <= x && x <= right && low <= y && y <= high;
  arena.discs.forEach(({ x, y, radius }, i) => {
    require(radius > 0, `arena.discs[${i}].radius`, radius, "more than 0 m; remove the disc to have none");
    require(inside(x, y), `arena.discs[${i}] centre`, [x, y], "inside the walls; move or remove the disc");
  });
  const corners = arena.polygons.reduce((sum, { vertices }) => sum + vertices.length, 0);
  require(corners <= MOST_EDGES, "arena.polygons", `${corners} corners`, `at most ${MOST_EDGES} in all`);
  arena.polygons.forEach(({ vertices }, i) => {
    const name = `arena.polygons[${i}].vertices`;
    require(vertices.length >= 3, name, `${vertices.length} corners`, `3 to ${MOST_CORNERS}`);
    require(vertices.every(([x, y]) => inside(x, y)), name, vertices, "inside the walls; move them");
    require(!hasMeetingEdges(vertices), name, vertices, "the corners in order around the obstacle, whose edges meet nowhere else");
  });
  if (arena.territory) {
    const { x, y, radius } = arena.territory;
    require(radius > 0, "arena.territory.radius", radius, "more than 0 m");
    require(inside(x, y), "arena.territory centre", [x, y], "inside the walls; move or remove it");
  }
  const isCovered = !ends || (ends.x_min <= left && right <= ends.x_max && ends.y_min <= low && high <= ends.y_max);
  require(isCovered, "arena walls", [left, right, low, high], "within the map's ends; leave them out to have just these");
}

/** Whether edges meet elsewhere than at a corner they share. */
export function hasMeetingEdges(corners) {
  const count = corners.length;
  const edges = corners.map(([x, y], index) => {
    const [toX, toY] = corners[(index + 1) % count];
    const length = Math.max(Math.hypot(toX - x, toY - y), APART);
    return { x, y, along: [(toX - x) / length, (toY - y) / length], length };
  });
  /** How far a corner is to the left of an edge's line, and how far ahead along it [m]. */
  const beside = ({ x, y, along: [alongX, alongY] }, [px, py]) => [alongX * (py - y) - alongY * (px - x), alongX * (px - x) + alongY * (py - y)];
  const isParted = (edge, index) => beside(edge, corners[index])[0] * beside(edge, corners[(index + 1) % count])[0] < 0;
  return edges.some((edge, i) =>
    corners.some((corner, j) => {
      const [left, ahead] = beside(edge, corner);
      const isOther = j !== i && j !== (i + 1) % count;
      const touches = isOther && Math.abs(left) <= APART && ahead >= -APART && ahead <= edge.length + APART;
      return touches || (isParted(edge, j) && isParted(edges[j], i));
    }),
  );
}

/** Two robots must find room to start, both at once and far enough apart. */
function checkRoom({ arena, starts, pursuer, evader }) {
  const random = makeRandom(0);
  const within = (low, high) => low + (high - low) * random();
  for (let draw = 0; draw < DRAWS; draw++) {
    const places = [pursuer, evader].map((body) => {
      const [x, y] = [within(arena.x_min, arena.x_max), within(arena.y_min, arena.y_max)];
      return { x, y, fits: clearance(arena, x, y) >= starts.clearance + body.radius };
    });
    const [one, two] = places;
    const goal = arena.territory;
    const isOutside = !goal || Math.hypot(two.x - goal.x, two.y - goal.y) >= goal.radius + starts.separation;
    const isApart = Math.hypot(one.x - two.x, one.y - two.y) >= starts.separation;
    if (one.fits && two.fits && isOutside && isApart) return;
  }
  throw new Error("the arena leaves the robots no place to start: make the obstacles or the robots smaller, or the arena larger");
}
