// How a game ended, once more and slowly: its last moments, from near by, beside the arena.

import { clip } from "./clearance.js";
import { between, draw } from "./draw.js";

const LASTS = 3; // seconds of a person's time
const SLOWER = 2; // times slower than it was
const NEAREST = 1.6; // half of what is seen at least [m]

/** The slow replay of a game that is over. `begun` is when it began [s]; it shows the state of number `from` too, if any. */
export class SlowReplay {
  constructor(match, begun, from) {
    const steps = Math.max(2, Math.round(LASTS / SLOWER / match.game.dt) + 1);
    const first = Math.min(from ?? Infinity, Math.max(match.states.length - steps, 0));
    Object.assign(this, { match, begun, states: match.states.slice(first) });
  }

  /** Draw it as it is at a time [s]; the last picture stays. */
  draw(canvas, now, colours) {
    const { states, match } = this;
    const at = clip((now - this.begun) / SLOWER / match.game.dt, 0, states.length - 1);
    const index = Math.min(Math.floor(at), states.length - 2);
    draw(canvas, {
      game: match.game,
      states: states.slice(0, index + 1),
      now: between(states[index], states[index + 1], at - index),
      colours,
      seen: this.#window(),
    });
  }

  /** A square around where both are in the end, or around who failed if they are far apart. */
  #window() {
    const { pursuer, evader } = this.states.at(-1);
    const failed = { pursuer, evader }[this.match.outcome.split("_")[0]];
    const middle = failed ?? { x: (pursuer.x + evader.x) / 2, y: (pursuer.y + evader.y) / 2 };
    const apart = failed ? 0 : Math.hypot(pursuer.x - evader.x, pursuer.y - evader.y) / 2;
    const half = Math.max(NEAREST, apart + 0.6);
    return { x_min: middle.x - half, x_max: middle.x + half, y_min: middle.y - half, y_max: middle.y + half };
  }
}
