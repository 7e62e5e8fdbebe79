// A lesson: pursuers of one training, each after another share of it, hunt the same blue from the same start, side by side.
// Nobody steers. When all games are over the next start follows by itself.

import { findGame } from "./files.js";
import { EVADER, PURSUER } from "./game.js";
import { ofLevel } from "./levels.js";
import { Match } from "./match.js";
import { findPlayer } from "./players.js";

const PACE = 2; // times faster than the clock
const REST = 2.5; // between two starts [s]
const LONGEST_PAUSE = 0.25; // of the clock, when a browser held frames back [s]

/** What blue can do in a lesson: the name of a player, and words for it. */
export const BLUES = { still: "stands still", "flee-aware": "flees" };

export class Lesson {
  /** @param matches one of each pursuer, all of one game; `record` is what the catalogue says of the training */
  constructor(level, record, matches) {
    Object.assign(this, { level, record, matches, rounds: 0, isPaused: false });
    this.begins("again");
  }

  /** What blue does: a name in `BLUES`. */
  get blue() {
    return this.record.blue;
  }

  get game() {
    return this.matches[0].game;
  }

  get isOver() {
    return this.matches.every(({ isOver }) => isOver);
  }

  /** Begin all games again, `again` at the same start or `next` at another one. */
  begins(how) {
    const [first, ...others] = this.matches;
    first[how]();
    for (const match of others) {
      match.start = first.start;
      match.again();
    }
    Object.assign(this, { time: 0, rested: 0 });
  }

  /** Let some time [s] of the clock pass. */
  pass(seconds) {
    if (this.isPaused) return;
    if (this.isOver) {
      this.rested += seconds;
      if (this.rested > REST) this.begins("next");
      return;
    }
    const { dt } = this.game;
    this.time += PACE * Math.min(seconds, LONGEST_PAUSE);
    for (; this.time >= dt; this.time -= dt) {
      for (const match of this.matches) if (!match.isOver) match.step();
    }
    if (this.isOver) this.rounds += 1;
  }
}

/** Return the lesson of a level, with a blue that does what a name in `BLUES` says. */
export async function openLesson(catalogue, level, blue) {
  const game = ofLevel(await findGame(catalogue, level.game), level);
  const evader = await findPlayer(catalogue, blue, EVADER, "sharp");
  const pursuers = await Promise.all(catalogue.learning.pupils.map(({ name }) => findPlayer(catalogue, name, PURSUER, "sharp")));
  const matches = pursuers.map((pursuer) => new Match(game, { pursuer: [pursuer], evader: [evader] }, level.seed));
  return new Lesson(level, { ...catalogue.learning, blue }, matches);
}
