// How robots that cannot move sideways get somewhere: what players that follow rules share, as `agents/classical.py` and
// `agents/chasing.py` of the package have it.

import { wrapAngle } from "./rules.js";

/** The direction [rad] in which one place is seen from another. */
export const direction = (from, to) => Math.atan2(to.y - from.y, to.x - from.x);

/** Distance [m] between two places. */
export const separation = (one, two) => Math.hypot(two.x - one.x, two.y - one.y);

/** The highest speed [m/s] at which a robot can drive the arc to a target; what is behind takes half the distance. */
export function arcSpeed(body, robot, target) {
  const angle = Math.abs(wrapAngle(direction(robot, target) - robot.heading));
  const sine = Math.sin(Math.min(angle, Math.PI / 2));
  return Math.min(body.v_max, (body.u2_max * separation(robot, target)) / Math.max(2 * sine, 1e-6));
}

/** The part [m/s] of the top speed that a robot which cannot move sideways can have now on the way to a heading. */
export const facingSpeed = (body, robot, heading) => body.v_max * Math.max(Math.cos(wrapAngle(heading - robot.heading)), 0);
