// The rules of the game, function by function those of `apollonius/game/`, in plain JavaScript.
//
// A robot is {x [m], y [m], v [m/s], heading [rad, in (-pi, pi]]}; a state is {pursuer, evader, steps}; a game is what
// `apollonius.arenas.record.to_dict` writes, a map with its field (`files.js`). Numbers of a state are rounded to single precision after each step, as
// those of the Python rules are, so that whole games agree and not steps alone.

import { clearance, clip, closestApproach, hitsObstacle, isOutOfRange, reachesTerritory } from "./clearance.js";

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
