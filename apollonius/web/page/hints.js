// Hints for a person: whether braking now would still do and, in the first game, the keys to try.

import { clearanceAlong } from "./calls.js";
import { bodyOf, gears } from "./game.js";

/** Return where a robot would come to rest if it braked straight ahead now. */
export function restOf(body, robot) {
  const reach = robot.v ** 2 / (2 * Math.max(body.u1_max, 1e-6));
  return { ...robot, x: robot.x + reach * Math.cos(robot.heading), y: robot.y + reach * Math.sin(robot.heading) };
}

/** Return whether a robot, {role, number}, that brakes straight ahead now would touch something. */
export function isTooFast(game, who, robot) {
  const body = bodyOf(game, who);
  return clearanceAlong(game.arena, robot, restOf(body, robot)) < body.radius;
}

const ENOUGH = 4; // steps for which a key has been used before it counts as known
const FAST = 0.7; // share of the top speed from which on there is something to brake

export class Coach {
  constructor() {
    this.used = { thrust: 0, turn: 0, brake: 0 };
  }

  /** See what a person has done in a step. */
  see(action) {
    const [thrust, turn] = gears(action);
    if (thrust > 0) this.used.thrust += 1;
    if (thrust < 0) this.used.brake += 1;
    if (turn !== 0) this.used.turn += 1;
  }

  /** The keys to show beside a robot now, or null. */
  advice(body, robot) {
    const isKnown = (what) => this.used[what] >= ENOUGH;
    if (!isKnown("thrust")) return "↑";
    if (!isKnown("turn")) return "←→";
    return !isKnown("brake") && robot.v > FAST * body.v_max ? "↓" : null;
  }
}
