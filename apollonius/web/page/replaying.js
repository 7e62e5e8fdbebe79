// How a game ended, once more and slowly: its last moments, from near by, beside the arena.

import { clip } from "./clearance.js";
import { between, draw } from "./draw.js";
import { ROLES, other } from "./rules.js";
import { isActive, opponentOf, robotOf, robotsOf } from "./teams.js";

const LASTS = 3; // seconds of a person's time
const SLOWER = 2; // times slower than it was
const NEAREST = 1.6; // half of what is seen at least [m]

/** The replay of a game that is over: it plays slowly to the end, or holds a moment. */
export class SlowReplay {
  constructor(match) {
    this.match = match;
    this.last = match.states.length - 1;
  }

  /** Play from a state, by its number, or from a few seconds before the end if that is earlier; `now` is the time [s]. */
  play(number, now) {
    const moments = Math.max(1, Math.round(LASTS / SLOWER / this.match.game.dt));
    this.#begin(Math.max(0, Math.min(number, this.last - moments)));
    Object.assign(this, { begun: now, held: null });
  }

  /** Hold the state of a number. */
  hold(number) {
    this.#begin(Math.min(number, this.last - 1));
    this.held = number;
  }

  #begin(first) {
    this.states = this.match.states.slice(first);
    Object.assign(this, { first, seen: this.#window() });
  }

  /** The number of the state that is shown at a time [s], which need not be whole; the last one stays. */
  at(now) {
    return this.held ?? clip(this.first + (now - this.begun) / SLOWER / this.match.game.dt, this.first, this.last);
  }

  /** Draw it as it is at a time [s]. */
  draw(canvas, now, colours) {
    const { states, match, seen } = this;
    const at = this.at(now) - this.first;
    const index = Math.min(Math.floor(at), states.length - 2);
    const robots = between(states[index], states[index + 1], at - index);
    draw(canvas, { game: match.game, states: states.slice(0, index + 1), now: robots, colours, seen });
  }

  /**
   * A square around the ways of those who were last put out of play, with the opponent that is nearest in the end to one
   * who was caught.
   */
  #window() {
    const [before, last] = this.states.slice(-2);
    const robots = robotsOf(last, ROLES);
    const gone = robots.filter((who) => isActive(robotOf(before, who)) && !isActive(robotOf(last, who)));
    const shown = (gone.length ? gone : robots).flatMap((who) => {
      const opponent = opponentOf(before, who);
      const hunter = robotsOf(before, [other(who.role)]).find((one) => robotOf(before, one) === opponent);
      return robotOf(last, who).status === "captured" ? [who, hunter] : [who];
    });
    const places = this.states.flatMap((state) => shown.map((who) => robotOf(state, who)));
    const [xs, ys] = [places.map(({ x }) => x), places.map(({ y }) => y)];
    const [left, right, low, high] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    const half = Math.max(NEAREST, Math.max(right - left, high - low) / 2 + 0.6);
    const [x, y] = [(left + right) / 2, (low + high) / 2];
    return { x_min: x - half, x_max: x + half, y_min: y - half, y_max: y + half };
  }
}
