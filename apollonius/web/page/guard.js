// The shield of a person's robot: it brakes in the person's place, in some levels as often as need be, in others a few times.

import { canStop } from "./calls.js";
import { ACTIONS } from "./game.js";
import { shielded } from "./players.js";

const CALM = 1; // for how long a person steers well until the shield has done its work [s]
const BRAKES = [1, 0, 2]; // the actions that brake, straight ahead first

export class Guard {
  /** @param times how often it helps in a game: Infinity, a number, or 0 */
  constructor(times = 0) {
    this.times = times;
    this.games = new WeakMap(); // by the states of a game: {used, until}, how often it has helped, and to which step it does
  }

  #of(states) {
    if (!this.games.has(states)) this.games.set(states, { used: 0, until: -1 });
    return this.games.get(states);
  }

  /** What it makes of the action that a person wants. */
  action(wanted, game, state, who, states) {
    const known = this.#of(states);
    const isHelping = state.steps <= known.until;
    if (canStop(game, state, who, wanted)) return wanted;
    if (!isHelping && known.used >= this.times) return wanted;
    if (!isHelping) known.used += 1;
    known.until = state.steps + Math.round(CALM / game.dt);
    return shielded(() => [...BRAKES, ...ACTIONS])(game, state, who, states)[0];
  }

  /** Whether it helps in the last of a game's states, and how often it still can after that. */
  statusOf(states) {
    const { used, until } = this.#of(states);
    return { isHelping: states.length - 1 <= until, left: this.times - used };
  }
}
