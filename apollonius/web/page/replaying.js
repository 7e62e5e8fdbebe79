// How a game ended, once more and slowly: its last moments, from near by, beside the arena.

import { clip } from "./clearance.js";
import { between, draw } from "./draw.js";
import { ROLES } from "./rules.js";
import { isActive, robotOf, robotsOf } from "./teams.js";
import { look } from "./view.js";

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

  /** A square around those who were last put out of play, with the opponent that is nearest to one who was caught. */
  #window() {
    const [before, last] = this.states.slice(-2);
    const robots = robotsOf(last, ROLES);
    const gone = robots.filter((who) => isActive(robotOf(before, who)) && !isActive(robotOf(last, who)));
    const places = (gone.length ? gone : robots).flatMap((who) => {
      const { opponent } = look(this.match.game, before, who);
      const robot = robotOf(last, who);
      return robot.status === "captured" ? [robot, opponent.state] : [robot];
    });
    const [xs, ys] = [places.map(({ x }) => x), places.map(({ y }) => y)];
    const [left, right, low, high] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    const half = Math.max(NEAREST, Math.max(right - left, high - low) / 2 + 0.6);
    const [x, y] = [(left + right) / 2, (low + high) / 2];
    return { x_min: x - half, x_max: x + half, y_min: y - half, y_max: y + half };
  }
}
