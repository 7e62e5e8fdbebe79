// The rules of the game as the page has them.
//
// A robot is {x [m], y [m], v [m/s], heading [rad, in (-pi, pi]], status}; a state is {pursuer, evader, steps}, a list of
// robots for either side, one in a game of two; a game is what `apollonius.arenas.record.to_dict` writes, a map with its field
// (`files.js`). Where robots go and what befalls them the package's own functions say (`programs.js`).

import { clearance, clip } from "./clearance.js";
import { MOST_ROBOTS, STATUSES, handArena, handRobot, handRobots } from "./handing.js";
import { given, run } from "./programs.js";
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

/** The robot after holding an action for `dt` [s] (Eq. 1). */
export function move(body, robot, action, dt) {
  handRobot(body, robot);
  given.gears().set(gears(action));
  const { x, y, v, heading } = run.move(dt);
  return { x: x[0], y: y[0], v: v[0], heading: heading[0] };
}

// ---- game.py

/**
 * One transition: all robots hold their actions for `dt`, and those that are not in play stand still.
 *
 * @param actions {pursuer, evader}: of each robot of either side
 * @returns {state, outcome}
 */
export function step(game, state, actions) {
  handArena(game.arena);
  handRobots(game, state, ROLES);
  ROLES.forEach((role, side) => {
    state[role].forEach((robot, index) => given.gears().set(isActive(robot) ? gears(actions[role][index]) : [0, 0], 2 * (side * MOST_ROBOTS + index)));
  });
  const judged = game.teams?.mates_collide ? run.step_of_bodies : run.step;
  const found = judged(game.capture_distance, game.dt, game.max_steps - state.steps);
  const { x, y, v, heading } = found.states();
  const [status, [outcome]] = [found.status(), found.outcome()];
  const after = (role, side) => state[role].map((_, index) => {
    const at = side * MOST_ROBOTS + index;
    return { x: x[at], y: y[at], v: v[at], heading: heading[at], status: STATUSES[status[at]] };
  });
  const [pursuer, evader] = ROLES.map(after);
  return { state: { pursuer, evader, steps: state.steps + 1 }, outcome: OUTCOMES[outcome] };
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
