// The rules of the game, function by function those of `apollonius/game/`, in plain JavaScript.
//
// A robot is {x [m], y [m], v [m/s], heading [rad, in (-pi, pi]], status}; a state is {pursuer, evader, steps}, a list of
// robots for either side, one in a game of two; a game is what `apollonius.arenas.record.to_dict` writes, a map with its field
// (`files.js`). Numbers of a state are rounded to single precision after each step, as those of the Python rules are, so that
// whole games agree and not steps alone.

import { clearance, clip, closestApproach, hitsObstacle, isOutOfRange, reachesTerritory } from "./clearance.js";
import { bodiesOf, countsOf, isActive } from "./teams.js";

export const PURSUER = "pursuer";
export const EVADER = "evader";
export const ROLES = [PURSUER, EVADER];
export const HOLD = 4; // the action that keeps the speed and goes straight

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

// ---- outcome.py, judge.py, game.py

/** Whether two robots, each {before, after}, come closer than a distance [m] to each other anywhere along a step. */
function comeWithin(one, two, distance) {
  const [x, y] = [two.before.x - one.before.x, two.before.y - one.before.y];
  return closestApproach(x, y, two.after.x - one.after.x - x, two.after.y - one.after.y - y) < distance;
}

/** The status of a robot after a step, from the states at its two ends: what befalls it, if it was in play. */
function statusAfter(game, before, after, role, number) {
  const way = (side, index) => ({ before: before[side][index], after: after[side][index] });
  const own = way(role, number);
  if (!isActive(own.before)) return own.before.status;
  const meets = (side, distance) => before[side].some((robot, index) => {
    const isOther = side !== role || index !== number;
    return isOther && isActive(robot) && comeWithin(way(side, index), own, distance(index));
  });
  if (role === EVADER && meets(PURSUER, () => game.capture_distance)) return "captured";
  const bodies = bodiesOf(game, role);
  const { radius } = bodies[number];
  if (hitsObstacle(game.arena, own.before, own.after, radius)) return "hit_obstacle";
  if (isOutOfRange(game.arena, own.after, radius)) return "out_of_range";
  const isHit = game.teams?.mates_collide && meets(role, (index) => radius + bodies[index].radius);
  return isHit ? "hit_mate" : "active";
}

/**
 * How the game stands after a step, from the states at its two ends: one of `OUTCOMES`. A side is beaten when none of its
 * robots is in play any more; the outcome is then that of the last of them.
 */
function judge(game, before, after) {
  const isBeaten = (role) => !after[role].some(isActive);
  const befell = (role, ...statuses) => {
    return after[role].some(({ status }, number) => statuses.includes(status) && isActive(before[role][number]));
  };
  if (isBeaten(EVADER) && befell(EVADER, "captured")) return "captured";
  const failures = ROLES.filter(isBeaten).map((role) => {
    return befell(role, "hit_obstacle", "hit_mate") ? `${role}_hit_obstacle` : `${role}_out_of_range`;
  });
  if (failures.length) return failures.length > 1 ? "both_failed" : failures[0];
  const reaches = (robot, number) => isActive(robot) && reachesTerritory(game.arena, before.evader[number], robot);
  if (game.arena.territory && after.evader.some(reaches)) return "territory_reached";
  return after.steps >= game.max_steps ? "no_result" : "ongoing";
}

/**
 * One transition: all robots hold their actions for `dt`, and those that are not in play stand still.
 *
 * @param actions {pursuer, evader}: of each robot of either side
 * @returns {state, outcome}
 */
export function step(game, state, actions) {
  const moved = (role) => {
    const bodies = bodiesOf(game, role);
    const end = (robot, number) => (isActive(robot) ? move(bodies[number], robot, actions[role][number], game.dt) : { ...robot, v: 0 });
    return state[role].map(end);
  };
  const after = { pursuer: moved(PURSUER), evader: moved(EVADER), steps: state.steps + 1 };
  const judged = (role) => after[role].map((robot, number) => ({ ...robot, status: statusAfter(game, state, after, role, number) }));
  const next = { ...after, pursuer: judged(PURSUER), evader: judged(EVADER) };
  return { state: next, outcome: judge(game, state, next) };
}

/** Who won: "pursuer", "evader" or null (outlived the time limit, or both failed). */
export function winner(game, outcome) {
  if (["captured", "evader_hit_obstacle", "evader_out_of_range"].includes(outcome)) return PURSUER;
  if (["pursuer_hit_obstacle", "pursuer_out_of_range", "territory_reached"].includes(outcome)) return EVADER;
  return outcome === "no_result" && game.reward.profile === "zero-sum" ? EVADER : null;
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

const [DRAWS, STARTS] = [1000, 100]; // of a team mate, and of the robots before it, until there is no room

/**
 * An initial state: uniform over the pairs of places with room, then mate by mate over what is left; headings uniform, as
 * slow as the robots can be. Throws an Error where the arena has no room for so many.
 */
export function drawStart(game, random) {
  for (let start = 0; start < STARTS; start++) {
    const state = drawPair(game, random);
    if (ROLES.every((role) => bodiesOf(game, role).slice(1).every((body) => drawMate(game, random, state, role, body)))) return state;
  }
  throw new Error(`the arena has no room for ${countsOf(game).join(" v ")}: take fewer robots, or a larger arena`);
}

/** A robot anywhere in the arena. */
function drawRobot({ arena, starts }, random, body) {
  const within = (low, high) => low + (high - low) * random();
  return {
    x: Math.fround(within(arena.x_min, arena.x_max)),
    y: Math.fround(within(arena.y_min, arena.y_max)),
    v: starts.speed === "moving" ? Math.fround(within(body.v_min, body.v_max)) : Math.max(body.v_min, 0),
    heading: Math.fround(within(-Math.PI, Math.PI)),
    status: "active",
  };
}

/** Whether a robot is far enough from walls and obstacles and, if it is an evader, from the territory. */
function hasRoom({ arena, starts }, robot, role, body) {
  if (clearance(arena, robot.x, robot.y) < starts.clearance + body.radius) return false;
  const { territory: goal } = arena;
  return role === PURSUER || !goal || Math.hypot(robot.x - goal.x, robot.y - goal.y) >= goal.radius + starts.separation;
}

const separation = (one, two) => Math.hypot(one.x - two.x, one.y - two.y);

/** The first robots of both sides. */
function drawPair(game, random) {
  for (;;) {
    const [pursuer, evader] = ROLES.map((role) => drawRobot(game, random, game[role]));
    const areIn = hasRoom(game, pursuer, PURSUER, game.pursuer) && hasRoom(game, evader, EVADER, game.evader);
    if (areIn && separation(pursuer, evader) >= game.starts.separation) return { pursuer: [pursuer], evader: [evader], steps: 0 };
  }
}

/** One more robot of a side, put into the state; returns whether there is room for it. */
function drawMate(game, random, state, role, body) {
  const { starts } = game;
  const bodies = bodiesOf(game, role);
  for (let draw = 0; draw < DRAWS; draw++) {
    const robot = drawRobot(game, random, body);
    const isClear = state[role].every((mate, number) => separation(robot, mate) >= starts.clearance + body.radius + bodies[number].radius);
    const isFar = state[other(role)].every((opponent) => separation(robot, opponent) >= starts.separation);
    if (!isClear || !isFar || !hasRoom(game, robot, role, body)) continue;
    state[role].push(robot);
    return true;
  }
  return false;
}
