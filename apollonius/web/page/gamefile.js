// Games from elsewhere, a JSON file or a link: what is left out has its default, and what cannot be played is refused with the
// value, the bound and the remedy, as `arenas/file.py` and `game/validation.py` do.

import { timeOfLeg } from "./calls.js";
import { MOST_MOVERS } from "./game.js";
import { hasMeetingEdges } from "./plan.js";
import { drawStart, makeRandom, withMovers } from "./starts.js";

const LONGEST = 20_000; // characters of a link

/** The game of a JSON text. Throws an Error in one line. */
export function readGame(text) {
  let said;
  try {
    said = JSON.parse(text);
  } catch (error) {
    throw new Error(error.message.replace(/\s+/g, " ").slice(0, 120));
  }
  const map = said?.arena?.map;
  if (map === undefined) return gameFrom(said);
  throw new Error(`this game is on the map ${String(map?.file ?? map).slice(0, 60)}: apollonius play --game FILE opens the page with it`);
}

/** Put bytes through a compressing or decompressing stream. */
const through = (stream, bytes) => new Response(new Blob([bytes]).stream().pipeThrough(stream)).arrayBuffer();

/** Return a mark and the JSON after it as the fragment of a link: compressed, in base64url. Throws an Error where it is too long. */
export async function asFragment(mark, json) {
  const bytes = new Uint8Array(await through(new CompressionStream("deflate-raw"), json));
  const letters = btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(""));
  if (letters.length > LONGEST) throw new Error("this game is too long for a link: save it");
  return mark + letters.replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "");
}

/** Return the JSON after a mark in a link's fragment, or null where there is no such mark. Throws an Error in one line. */
export async function fromFragment(mark, fragment) {
  if (!fragment.startsWith(mark)) return null;
  const letters = fragment.slice(mark.length).replaceAll("-", "+").replaceAll("_", "/");
  if (letters.length > LONGEST) throw new Error("it is too long");
  try {
    const bytes = Uint8Array.from(atob(letters), (letter) => letter.charCodeAt(0));
    return new TextDecoder("utf-8", { fatal: true }).decode(await through(new DecompressionStream("deflate-raw"), bytes));
  } catch {
    throw new Error("it is damaged; copy the whole link");
  }
}

const MAX_TURN = 2; // in one step [rad]
const MAX_SIZE = 1e6; // of any number
const MAX_STEPS = 2 ** 31 - 1;
const [MOST_DISCS, MOST_POLYGONS, MOST_CORNERS, MOST_EDGES] = [250, 500, 1000, 2000];
const SHORTEST = 0.01; // step [s] that the page keeps up with
const LONGEST_STOP = 1000; // steps that a robot may take to stop, as shields look so far ahead

const ROBOT = { v_min: 0, v_max: 1.2, u1_max: 0.3, u2_max: 0.8, radius: 0 };
/** What robots of other kinds have besides, or otherwise, as `game/models.py` says. */
const MODELS = {
  unicycle: {},
  car: { v_min: -0.6, u2_max: 0.42, wheelbase: 0.33 },
  wheels: { track: 0.4, wheel_speed: 1.2 },
  omni: { u2_max: 4, lateral_acceleration: 0.3 },
};
/** The game of an empty file: the paper's, without discs. Keys without a value may be left out. */
export const DEFAULT = {
  pursuer: ROBOT,
  evader: ROBOT,
  arena: { x_min: 0, x_max: 10, y_min: 0, y_max: 10, discs: [], polygons: [], territory: undefined, map: undefined },
  capture_distance: 0.3,
  dt: 0.1,
  max_steps: 1000,
  reward: { profile: "paper", capture: 10, failure: 10, progress: 3, along_paths: false },
  starts: { speed: "rest", clearance: 0.3, separation: 1 },
  movers: undefined,
};
const MOVERS = {
  shuttles: { waypoints: [], hx: 0, hy: 0, radius: 0.25, v_max: 0.8, a_max: 0.5, pause: 0 },
  doors: { x: null, y: null, hx: null, hy: null, radius: 0.05, period: 20, share_open: 0.5, v_max: 0.5, a_max: 0.5 },
  walkers: { count: 1, radius: 0.25, v_max: 1.3, a_max: 2 },
};
const MOST_WAYPOINTS = 20;
const SHORTEST_WAY = 0.01; // [m]
const DISC = { x: null, y: null, radius: null };

function require(isPossible, name, value, bound) {
  if (!isPossible) throw new Error(`${name} = ${shown(value)} is not possible: it must be ${bound}`);
}

/** A value in a message, however large or strange it is. */
function shown(value) {
  const text = typeof value === "string" ? value : (JSON.stringify(value) ?? String(value));
  return text.length > 60 ? `${text.slice(0, 60)}…` : text;
}

const isTable = (value) => value !== null && typeof value === "object" && !Array.isArray(value);

/** Fill a table, and those in it, by defaults: each key known, each number finite. */
function filled(said, defaults, name) {
  require(isTable(said), name, said, "a table of keys and values");
  const unknown = Object.keys(said).find((key) => !Object.hasOwn(defaults, key));
  if (unknown !== undefined) throw new Error(`${name}: unknown key '${shown(unknown)}'; remove it`);
  const made = {};
  for (const [key, usual] of Object.entries(defaults)) {
    const [value, called] = [Object.hasOwn(said, key) ? said[key] : usual, name === "game" && isTable(usual) ? key : `${name}.${key}`];
    if (usual === null || typeof usual === "number") {
      require(Number.isFinite(value), called, value, "a finite number");
      require(Math.abs(value) <= MAX_SIZE || key === "max_steps", called, value, `within ${MAX_SIZE} of 0`);
    }
    if (value !== undefined) made[key] = isTable(usual) ? filled(value, usual, called) : value;
  }
  return made;
}

/** The defaults of a robot of the kind that a table names. */
function robotDefaults(said, name) {
  const model = said?.model ?? "unicycle";
  require(Object.hasOwn(MODELS, model), `${name}.model`, model, `one of ${Object.keys(MODELS).join(", ")}`);
  return { ...ROBOT, ...MODELS[model], model: said?.model };
}

function list(value, name, most) {
  require(Array.isArray(value), name, value, "a list");
  require(value.length <= most, name, `${value.length} of them`, `at most ${most}; draw so many obstacles as an occupancy map`);
  return value;
}

/**
 * Return the checked game of nested tables, as of a JSON file.
 *
 * @param map {x, y, cell, rows, columns, field, file, sha256} of its map, if it has one
 * @throws Error in one line
 */
export function gameFrom(said, map = null) {
  require(!said?.scenario, "scenario", said?.scenario, "left out, as the page plays in one arena");
  for (const key of ["pursuers", "evaders", "teams", "mates_collide"]) {
    require(said?.[key] === undefined, key, said?.[key], "left out here: the numbers of robots are chosen under Games");
  }
  const ends = map && { x_min: map.x, x_max: map.x + (map.columns - 1) * map.cell, y_min: map.y, y_max: map.y + (map.rows - 1) * map.cell };
  const robots = Object.fromEntries(["pursuer", "evader"].map((side) => [side, robotDefaults(said?.[side], side)]));
  const game = filled(said, { ...DEFAULT, ...robots, arena: { ...DEFAULT.arena, ...ends } }, "game");
  const { arena } = game;
  arena.discs = list(arena.discs, "arena.discs", MOST_DISCS).map((disc, i) => filled(disc, DISC, `arena.discs[${i}]`));
  arena.polygons = list(arena.polygons, "arena.polygons", MOST_POLYGONS).map((polygon, i) => {
    const { vertices } = filled(polygon, { vertices: [] }, `arena.polygons[${i}]`);
    const name = `arena.polygons[${i}].vertices`;
    for (const corner of list(vertices, name, MOST_CORNERS)) {
      const isPoint = Array.isArray(corner) && corner.length === 2 && corner.every((one) => Number.isFinite(one) && Math.abs(one) <= MAX_SIZE);
      require(isPoint, name, corner, "[x, y] of each corner");
    }
    const isClosed = vertices.length > 1 && vertices.at(-1).join() === vertices[0].join();
    return { vertices: vertices.slice(0, isClosed ? -1 : undefined).map(([x, y]) => [x, y]) };
  });
  if (arena.territory !== undefined) arena.territory = filled(arena.territory, DISC, "arena.territory");
  if (map) arena.map = map;
  if (game.movers !== undefined) game.movers = moversFrom(game.movers, arena);
  check(game, ends);
  return game;
}

function check(game, ends) {
  const { dt, capture_distance: capture, max_steps: steps, starts, arena, reward } = game;
  require(["paper", "zero-sum"].includes(reward.profile), "reward.profile", reward.profile, "paper or zero-sum");
  require(typeof reward.along_paths === "boolean", "reward.along_paths", reward.along_paths, "true or false");
  require(["rest", "moving"].includes(starts.speed), "starts.speed", starts.speed, "rest or moving");
  require(dt >= SHORTEST, "dt", dt, `at least ${SHORTEST} s, which the page keeps up with`);
  require(Math.fround(capture) > 0, "capture_distance", capture, "more than 0 m");
  require(Number.isInteger(steps) && steps >= 1 && steps <= MAX_STEPS, "max_steps", steps, "a whole number, at least 1");
  for (const side of ["pursuer", "evader"]) checkBody(game[side], side, dt);
  checkArena(arena, ends);
  require(starts.clearance >= 0, "starts.clearance", starts.clearance, "0 m or more");
  require(starts.separation >= capture, "starts.separation", starts.separation, `at least capture_distance = ${capture} m`);
  withMovers(game, drawStart(game, makeRandom(0)), makeRandom(0)); // throws where there is no room to start
}

/** The checked movers of a table. */
function moversFrom(said, arena) {
  const made = filled(said, { shuttles: [], doors: [], walkers: [] }, "movers");
  for (const [kind, defaults] of Object.entries(MOVERS)) {
    require(Array.isArray(made[kind]), `movers.${kind}`, made[kind], "a list");
    made[kind] = made[kind].map((mover, index) => checkedMover(filled(mover, defaults, `movers.${kind}[${index}]`), `movers.${kind}[${index}]`, arena));
    const count = made[kind].reduce((sum, mover) => sum + (mover.count ?? 1), 0);
    require(count <= MOST_MOVERS[kind], `movers.${kind}`, `${count} of them`, `at most ${MOST_MOVERS[kind]} in the page`);
  }
  require(Object.values(made).some((movers) => movers.length), "movers", "empty", "shuttles, doors or walkers; or left out");
  return made;
}

function checkedMover(mover, name, { x_min: left, x_max: right, y_min: low, y_max: high }) {
  const { waypoints, count = 1, period, share_open: share, pause = 0, radius, v_max: fastest, a_max: most } = mover;
  const isInside = (point) => Array.isArray(point) && point.length === 2 && left <= point[0] && point[0] <= right && low <= point[1] && point[1] <= high;
  require(radius > 0, `${name}.radius`, radius, "more than 0 m");
  require(fastest > 0, `${name}.v_max`, fastest, "more than 0 m/s");
  require(most > 0, `${name}.a_max`, most, "more than 0 m/s^2");
  require(Number.isInteger(count) && count >= 1, `${name}.count`, count, "a whole number, at least 1");
  require(pause >= 0, `${name}.pause`, pause, "0 s or more");
  if (waypoints) {
    const isList = Array.isArray(waypoints) && waypoints.length >= 2 && waypoints.length <= MOST_WAYPOINTS && waypoints.every(isInside);
    require(isList, `${name}.waypoints`, waypoints, `2 to ${MOST_WAYPOINTS}, [x, y] of each, inside the walls`);
    const isApart = waypoints.slice(1).every(([x, y], index) => Math.hypot(x - waypoints[index][0], y - waypoints[index][1]) > SHORTEST_WAY);
    require(isApart, `${name}.waypoints`, waypoints, `more than ${SHORTEST_WAY} m between neighbours`);
  }
  if (share === undefined) return mover;
  const half = Math.hypot(mover.hx, mover.hy);
  require(half > SHORTEST_WAY, `${name}.hx, hy`, [mover.hx, mover.hy], `longer than ${SHORTEST_WAY} m`);
  require(isInside([mover.x, mover.y]), `${name} centre`, [mover.x, mover.y], "inside the walls; move it");
  require(share > 0 && share < 1, `${name}.share_open`, share, "between 0 and 1");
  const shortest = timeOfLeg(2 * half, fastest, most) / Math.min(share, 1 - share);
  require(period >= shortest, `${name}.period`, period, `at least ${shortest.toFixed(2)} s, to open and to close in`);
  return mover;
}

function checkBody(body, name, dt) {
  require(body.v_min <= body.v_max, `${name}.v_min`, body.v_min, `at most v_max = ${body.v_max} m/s`);
  require(body.v_max > 0, `${name}.v_max`, body.v_max, "more than 0 m/s");
  require(body.u1_max >= 0, `${name}.u1_max`, body.u1_max, "0 m/s^2 or more");
  require(body.u2_max >= 0, `${name}.u2_max`, body.u2_max, "0 rad/s or more");
  require(body.u2_max * dt <= MAX_TURN, `${name}.u2_max`, body.u2_max, `at most ${MAX_TURN} rad in a step`);
  checkKind(body, name, dt);
  require(body.radius >= 0, `${name}.radius`, body.radius, "0 m (a point) or more");
  // What only the page demands, as it plays at the clock's pace.
  const stops = body.v_max <= LONGEST_STOP * body.u1_max * dt;
  require(stops, `${name}.u1_max`, body.u1_max, `enough to stop from v_max = ${body.v_max} m/s within ${LONGEST_STOP} steps`);
}

/** Check the numbers that only robots of a kind have. */
function checkKind({ model, wheelbase, track, wheel_speed: rim, lateral_acceleration: across, ...body }, name, dt) {
  if (model === "car") {
    const fastest = Math.max(body.v_max, -body.v_min);
    require(wheelbase > 0, `${name}.wheelbase`, wheelbase, "more than 0 m");
    require(body.u2_max < Math.PI / 2, `${name}.u2_max`, body.u2_max, "less than pi / 2 rad: u2 is a car's steering angle");
    const turn = (fastest * dt * Math.tan(body.u2_max)) / wheelbase;
    require(turn <= MAX_TURN, `${name}.u2_max`, body.u2_max, `such that a step turns by at most ${MAX_TURN} rad`);
  }
  if (model === "wheels") {
    require(track > 0, `${name}.track`, track, "more than 0 m");
    for (const limit of ["v_min", "v_max"]) {
      require(Math.abs(body[limit]) <= rim, `${name}.${limit}`, body[limit], `at most wheel_speed = ${rim} m/s in size`);
    }
  }
  if (model === "omni") require(across > 0, `${name}.lateral_acceleration`, across, "more than 0 m/s^2");
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
    require(!hasMeetingEdges(vertices), name, vertices, "the corners in order around the obstacle, each once, whose edges meet nowhere else");
  });
  if (arena.territory) {
    const { x, y, radius } = arena.territory;
    require(radius > 0, "arena.territory.radius", radius, "more than 0 m");
    require(inside(x, y), "arena.territory centre", [x, y], "inside the walls; move or remove it");
  }
  const isCovered = !ends || (ends.x_min <= left && right <= ends.x_max && ends.y_min <= low && high <= ends.y_max);
  require(isCovered, "arena walls", [left, right, low, high], "within the map's ends; leave them out to have just these");
}
