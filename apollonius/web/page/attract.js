// A silent game: two trained agents play behind the start's card until a person begins.

import { IMPACT } from "./hindsight.js";
import { ROLES, bodiesOf } from "./game.js";
import { Match } from "./match.js";
import { ANYWHERE, findTeam } from "./players.js";
import { SHIELDED } from "./words.js";

const BEFORE = 5; // of each game, which is not shown: robots begin at rest [s]
const SEED = 7; // of a chase that ends soon after that on the first level's floor
const AT_ONCE = 12; // of a frame to play what is not shown [ms]
const LONGEST_PAUSE = 0.25; // of the clock, when a browser held frames back [s]

export class Attract {
  /** @param match between agents alone; `time` since its last step, or since its end [s] */
  constructor(match) {
    Object.assign(this, { match, time: 0 });
  }

  /** Whether there is something to be seen. */
  get isShown() {
    return this.match.seconds >= BEFORE || this.match.isOver;
  }

  /** Let some time [s] pass. After an end another game follows. */
  pass(seconds) {
    const { match } = this;
    const { dt } = match.game;
    const until = performance.now() + AT_ONCE;
    while (!this.isShown && performance.now() < until) match.step();
    if (!this.isShown) return;
    this.time += Math.min(seconds, LONGEST_PAUSE);
    if (match.isOver && this.time > IMPACT) {
      match.next();
      this.time = 0;
    }
    for (; this.time >= dt && !match.isOver; this.time -= dt) match.step();
  }
}

/** Return the silent game of a game's rules, or null where nobody can play it. */
export async function openAttract(catalogue, game) {
  if (game.sensors || !ROLES.every((role) => Object.hasOwn(catalogue.files, ANYWHERE[role]))) return null;
  const teams = ROLES.map((role) => findTeam(catalogue, SHIELDED + ANYWHERE[role], role, bodiesOf(game, role).length, "sharp"));
  const [pursuer, evader] = await Promise.all(teams);
  return new Attract(new Match(game, { pursuer, evader }, SEED));
}
