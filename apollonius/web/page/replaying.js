// How a game ended, once more and slowly.

import { clip } from "./game.js";

const LASTS = 3; // seconds of a person's time
const SLOWER = 2; // times slower than it was

/** The replay of a game that is over: it plays slowly to the end, or holds a moment. */
export class SlowReplay {
  constructor(match) {
    this.match = match;
    this.last = match.states.length - 1;
  }

  /** Play from a state, by its number, or from a few seconds before the end if that is earlier; `now` is the time [s]. */
  play(number, now) {
    const moments = Math.max(1, Math.round(LASTS / SLOWER / this.match.game.dt));
    Object.assign(this, { first: clip(number, 0, Math.max(0, this.last - moments)), begun: now, held: null });
  }

  /** Hold the state of a number. */
  hold(number) {
    this.held = number;
  }

  /** The number of the state that is shown at a time [s], which need not be whole; the last one stays. */
  at(now) {
    return this.held ?? clip(this.first + (now - this.begun) / SLOWER / this.match.game.dt, this.first, this.last);
  }
}
