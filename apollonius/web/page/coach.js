// The first game explains itself: beside the person's robot stand the keys to try, until they have been tried.

import { gears } from "./rules.js";

const ENOUGH = 4; // steps for which a gear has been used before it counts as known
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
