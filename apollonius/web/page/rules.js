// The rules of the game, function by function those of `apollonius/game/`, in plain JavaScript.
//
// A robot is {x [m], y [m], v [m/s], heading [rad, in (-pi, pi]]}; a state is {pursuer, evader, steps}; a game is what
// `apollonius.arenas.record.to_dict` writes. Numbers of a state are rounded to single precision after each step, as
// those of the Python rules are, so that whole games agree and not steps alone.

export const PURSUER = "pursuer";
export const EVADER = "evader";

export const OUTCOMES = [
  "ongoing",
  "captured",
  "pursuer_hit_obstacle",
  "evader_hit_obstacle",
  "pursuer_out_of_range",
  "evader_out_of_range",
  "both_failed",
  "no_result",
  "territory_reached",
];

export function other(role) {
  return role === PURSUER ? EVADER : PURSUER;
}

const clip = (value, low, high) => Math.min(Math.max(value, low), high);

/** The same direction in (-pi, pi] [rad]. */
export function wrapAngle(angle) {
  return angle - 2 * Math.PI * Math.ceil((angle - Math.PI) / (2 * Math.PI));
}

// ---- dynamics.py

/** Whether an action is a pair of gears, and not one of the discrete ones 0..8. */
export const isContinuous = (action) => Array.isArray(action);

/** The shares of u1_max and u2_max that an action asks for: of a discrete one -1, 0 or 1 each; others are clipped. */
export function gears(action) {
  if (isContinuous(action)) return action.map((share) => clip(share, -1, 1));
  return [Math.floor(action / 3) - 1, (action % 3) - 1];
}

/** Acceleration [m/s^2] and turn rate [rad/s] of an action (Eq. 4, 5). */
export function controls(body, action) {
  const [gearU1, gearU2] = gears(action);
  return [gearU1 * body.u1_max, gearU2 * body.u2_max];
}

// The mean speed of a step whose change [m/s] is below this is the speed at its end. A rounded speed can be beyond its
// limit by more than a tinier change, for which the formula of the ramp would be far off.
const LEAST_CHANGE = 1e-6;

/** The robot after holding an action for `dt` [s] (Eq. 1). */
export function move(body, robot, action, dt) {
  const [u1, u2] = controls(body, action);
  const dv = u1 * dt;
  const v = clip(robot.v + dv, body.v_min, body.v_max);
  const meanV = Math.abs(dv) < LEAST_CHANGE ? v : v - (v - robot.v) ** 2 / (2 * dv);
  const halfTurn = (u2 * dt) / 2;
  const chord = meanV * dt * (halfTurn === 0 ? 1 : Math.sin(halfTurn) / halfTurn);
  const middle = robot.heading + halfTurn;
  return {
    x: Math.fround(robot.x + chord * Math.cos(middle)),
    y: Math.fround(robot.y + chord * Math.sin(middle)),
    v: Math.fround(v),
    heading: Math.fround(wrapAngle(robot.heading + 2 * halfTurn)),
  };
}

// ---- arena.py

/** Distance [m] from the origin to the segment from (px, py) to (px + dx, py + dy). */
function closestApproach(px, py, dx, dy) {
  const lengthSquared = dx * dx + dy * dy;
  const fraction = clip(-(px * dx + py * dy) / Math.max(lengthSquared, 1e-12), 0, 1);
  return Math.hypot(px + fraction * dx, py + fraction * dy);
}

function toWalls(arena, x, y) {
  return Math.min(x - arena.x_min, arena.x_max - x, y - arena.y_min, arena.y_max - y);
}

/** Edges of a polygon, each as the corner it begins at and the way to the next: [x, y, alongX, alongY]. */
function edges({ vertices }) {
  return vertices.map(([x, y], index) => {
    const [nextX, nextY] = vertices[(index + 1) % vertices.length];
    return [x, y, nextX - x, nextY - y];
  });
}

/** How far a point is to the left of an edge's line, times the edge's length. */
const side = ([x, y, alongX, alongY], px, py) => alongX * (py - y) - alongY * (px - x);

/** Distance [m] from a point to the nearest edge of a polygon; negative inside. */
function toPolygon(polygon, px, py) {
  let [least, inside] = [Infinity, false];
  for (const edge of edges(polygon)) {
    const [x, y, alongX, alongY] = edge;
    least = Math.min(least, closestApproach(x - px, y - py, alongX, alongY));
    const [above, endsAbove] = [y > py, y + alongY > py];
    if (above !== endsAbove && side(edge, px, py) > 0 === endsAbove) inside = !inside;
  }
  return inside ? -least : least;
}

const PASSED_THROUGH = -1e-6;

/** None in games that were recorded before there were polygons. */
const polygonsOf = (arena) => arena.polygons ?? [];

/** Least clearance [m] from a polygon on the segment between two states (polygon.py). */
function polygonAlong(polygon, before, after) {
  const [dx, dy] = [after.x - before.x, after.y - before.y];
  const step = [before.x, before.y, dx, dy];
  let least = Math.min(toPolygon(polygon, before.x, before.y), toPolygon(polygon, after.x, after.y));
  for (const edge of edges(polygon)) {
    const [x, y, alongX, alongY] = edge;
    const crossed =
      side(edge, before.x, before.y) * side(edge, after.x, after.y) < 0 &&
      side(step, x, y) * side(step, x + alongX, y + alongY) < 0;
    least = Math.min(least, crossed ? PASSED_THROUGH : closestApproach(before.x - x, before.y - y, dx, dy));
  }
  return least;
}

/** Distance [m] from a point to the nearest wall or obstacle; negative outside the walls or inside an obstacle. */
export function clearance(arena, x, y) {
  const toDiscs = arena.discs.map((disc) => Math.hypot(x - disc.x, y - disc.y) - disc.radius);
  const toPolygons = polygonsOf(arena).map((polygon) => toPolygon(polygon, x, y));
  return Math.min(toWalls(arena, x, y), ...toDiscs, ...toPolygons);
}

/** Least clearance [m] from each obstacle on the segment between two states of a robot. */
function obstaclesAlong(arena, before, after) {
  const toDiscs = arena.discs.map(
    (disc) =>
      closestApproach(before.x - disc.x, before.y - disc.y, after.x - before.x, after.y - before.y) - disc.radius,
  );
  return [...toDiscs, ...polygonsOf(arena).map((polygon) => polygonAlong(polygon, before, after))];
}

/** Least clearance [m] on the segment between two states of a robot. */
export function clearanceAlong(arena, before, after) {
  const walls = Math.min(toWalls(arena, before.x, before.y), toWalls(arena, after.x, after.y));
  return Math.min(walls, ...obstaclesAlong(arena, before, after));
}

function hitsObstacle(arena, before, after, radius) {
  return obstaclesAlong(arena, before, after).some((clearance) => clearance < radius);
}

/** Whether a robot's centre comes into the territory on the segment between two states. */
function reachesTerritory({ territory }, before, after) {
  const [x, y] = [before.x - territory.x, before.y - territory.y];
  return closestApproach(x, y, after.x - before.x, after.y - before.y) < territory.radius;
}

function isOutOfRange(arena, after, radius) {
  return toWalls(arena, after.x, after.y) < radius;
}

// ---- outcome.py, game.py

function isCaptured(before, after, captureDistance) {
  const x = before.evader.x - before.pursuer.x;
  const y = before.evader.y - before.pursuer.y;
  const dx = after.evader.x - after.pursuer.x - x;
  const dy = after.evader.y - after.pursuer.y - y;
  return closestApproach(x, y, dx, dy) < captureDistance;
}

/** How the game stands after a step, from the states at its two ends: one of `OUTCOMES`. */
export function judge(game, before, after) {
  if (isCaptured(before, after, game.capture_distance)) return "captured";
  const failures = [PURSUER, EVADER].map((role) => {
    const radius = game[role].radius;
    if (hitsObstacle(game.arena, before[role], after[role], radius)) return `${role}_hit_obstacle`;
    return isOutOfRange(game.arena, after[role], radius) ? `${role}_out_of_range` : null;
  });
  if (failures[0] && failures[1]) return "both_failed";
  const fails = failures[0] ?? failures[1];
  if (fails) return fails;
  if (game.arena.territory && reachesTerritory(game.arena, before.evader, after.evader)) return "territory_reached";
  return after.steps >= game.max_steps ? "no_result" : "ongoing";
}

/** One transition: both robots hold their actions for `dt`; returns {state, outcome}. */
export function step(game, state, actions) {
  const after = {
    pursuer: move(game.pursuer, state.pursuer, actions.pursuer, game.dt),
    evader: move(game.evader, state.evader, actions.evader, game.dt),
    steps: state.steps + 1,
  };
  return { state: after, outcome: judge(game, state, after) };
}

/** Who won: "pursuer", "evader" or null (outlived the time limit, or both failed). */
export function winner(game, outcome) {
  if (["captured", "evader_hit_obstacle", "evader_out_of_range"].includes(outcome)) return PURSUER;
  if (["pursuer_hit_obstacle", "pursuer_out_of_range", "territory_reached"].includes(outcome)) return EVADER;
  return outcome === "no_result" && game.reward.profile === "zero-sum" ? EVADER : null;
}

// ---- observation.py

const scale = (value, low, high) => (2 * value - (low + high)) / Math.max(high - low, 1e-6);

function positionAndSpeed(arena, body, robot) {
  return [
    scale(robot.x, arena.x_min, arena.x_max),
    scale(robot.y, arena.y_min, arena.y_max),
    scale(robot.v, body.v_min, body.v_max),
  ];
}

function clearances(arena, body, robot) {
  const braking = Math.max(robot.v, 0) ** 2 / Math.max(2 * body.u1_max, 1e-6);
  const here = clearance(arena, robot.x, robot.y);
  const x = robot.x + braking * Math.cos(robot.heading);
  const y = robot.y + braking * Math.sin(robot.heading);
  return [clip(here - body.radius, -1, 1), clip(clearance(arena, x, y) - body.radius, -1, 1)];
}

/** What one side sees, in the named profile: `paper`, 8 numbers (Eq. 7), or `encoded`, 17. */
export function observe(profile, game, state, role) {
  const arena = game.arena;
  const robots = [role, other(role)].map((side) => [game[side], state[side]]);
  const [own, opponent] = robots.map(([, robot]) => robot);
  if (profile === "paper") {
    return robots.flatMap(([body, robot]) => [...positionAndSpeed(arena, body, robot), robot.heading / Math.PI]);
  }
  const size = Math.max(arena.x_max - arena.x_min, arena.y_max - arena.y_min);
  const dx = (opponent.x - own.x) / size;
  const dy = (opponent.y - own.y) / size;
  const cos = Math.cos(own.heading);
  const sin = Math.sin(own.heading);
  return [
    ...robots.flatMap(([body, robot]) => [
      ...positionAndSpeed(arena, body, robot),
      Math.cos(robot.heading),
      Math.sin(robot.heading),
    ]),
    ...[cos * dx + sin * dy, cos * dy - sin * dx, Math.hypot(dx, dy)],
    ...robots.flatMap(([body, robot]) => clearances(arena, body, robot)),
  ];
}

// ---- starts.py

/** Numbers uniform in [0, 1) from a seed: mulberry32. The page's own; the Python rules draw from JAX's. */
export function makeRandom(seed) {
  let state = seed >>> 0;
  return () => {
    state = (state + 0x6d2b79f5) >>> 0;
    let bits = Math.imul(state ^ (state >>> 15), state | 1);
    bits ^= bits + Math.imul(bits ^ (bits >>> 7), bits | 61);
    return ((bits ^ (bits >>> 14)) >>> 0) / 2 ** 32;
  };
}

/** An initial state: uniform over the pairs of places with room, headings uniform, as slow as the robots can be. */
export function drawStart(game, random) {
  const { arena, starts } = game;
  const within = (low, high) => low + (high - low) * random();
  const place = (body) => ({
    x: Math.fround(within(arena.x_min, arena.x_max)),
    y: Math.fround(within(arena.y_min, arena.y_max)),
    v: starts.speed === "moving" ? Math.fround(within(body.v_min, body.v_max)) : Math.max(body.v_min, 0),
    heading: Math.fround(within(-Math.PI, Math.PI)),
  });
  const hasRoom = (body, robot) => clearance(arena, robot.x, robot.y) >= starts.clearance + body.radius;
  for (;;) {
    const pursuer = place(game.pursuer);
    const evader = place(game.evader);
    const apart = Math.hypot(pursuer.x - evader.x, pursuer.y - evader.y) >= starts.separation;
    const { territory: goal } = arena;
    const outside = !goal || Math.hypot(evader.x - goal.x, evader.y - goal.y) >= goal.radius + starts.separation;
    if (apart && outside && hasRoom(game.pursuer, pursuer) && hasRoom(game.evader, evader)) return { pursuer, evader, steps: 0 };
  }
}
