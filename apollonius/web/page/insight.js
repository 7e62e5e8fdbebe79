// Explanations of a match: the values of its players, their expected actions, and until when
// one who crashed could have braked; with what the rules alone say.

import { step } from "./calls.js";
import { EVADER, HOLD, bodyOf, isActive, robotOf } from "./game.js";
import { known, stoppable } from "./layers.js";
import { decided } from "./match.js";

const AHEAD = 2; // how far is looked ahead [s]
const BUDGET = 1; // for looking ahead, in a frame [ms]

/** Return an agent's values of the nine actions, from 0, the worst, to 1, the best, or null. */
function opinions({ values }, game, state, who) {
  if (!values) return null;
  const found = [...values(game, state, who)];
  const [least, most] = [Math.min(...found), Math.max(...found)];
  return found.map((value) => (value - least) / Math.max(most - least, 1e-9));
}

/** Return whether a robot is out of play because it touched a wall or an obstacle. */
export const hasCrashed = (state, who) => ["hit_obstacle", "out_of_range"].includes(robotOf(state, who).status);

/**
 * The last state of a game, as its number, from which a robot, {role, number}, that crashed could still have braked in time;
 * null where it did not crash, or never could.
 */
export function lastBrake({ game, state, states }, who) {
  if (!hasCrashed(state, who)) return null;
  const isInTime = (robot) => isActive(robot) && stoppable(game, bodyOf(game, who), robot).includes(true);
  const last = states.findLastIndex((state) => isInTime(robotOf(state, who)));
  return last < 0 ? null : last;
}

/** Looks ahead a little in every frame; `course` is what it has last seen to its end: states, from where it began. */
class Foresight {
  constructor(match) {
    Object.assign(this, { match, course: [], states: null, begins: 0 });
  }

  look() {
    const { match } = this;
    if (!this.states) [this.states, this.begins] = [[...match.states], match.states.length - 1];
    const until = performance.now() + BUDGET;
    const last = this.begins + Math.round(AHEAD / match.game.dt);
    let isOver = match.isOver;
    while (!isOver && this.states.length <= last && performance.now() < until) isOver = this.#step();
    if (isOver || this.states.length > last) [this.course, this.states] = [this.states.slice(this.begins), null];
  }

  #step() {
    const { game, players, actions } = this.match;
    const { states } = this;
    const state = states.at(-1);
    const held = ({ role, number }) => actions.at(-1)?.[number + (role === EVADER ? state.pursuer.length : 0)] ?? HOLD;
    const taken = decided(players, states, ({ rank }, who, told) => (rank ? rank(game, state, who, states, told)[0] : held(who)));
    const after = step(game, state, taken);
    this.states.push(after.state);
    return after.outcome !== "ongoing";
  }
}

/** Explanations of a match, worked out once for each state and selection of layers. */
export class Insight {
  constructor(match) {
    Object.assign(this, { match, state: null, wanted: "", found: null, foresight: new Foresight(match) });
  }

  /**
   * What the layers show now.
   *
   * @param shown keys of `LAYERS`
   * @returns {robots, leads, course}: what `known` says, and states to come; null where they are not shown
   */
  of(shown) {
    const { match } = this;
    const { game, players, state } = match;
    if (state !== this.state || shown.join() !== this.wanted) {
      [this.state, this.wanted] = [state, shown.join()];
      this.found = known(game, state, shown, (who) => opinions(robotOf(players, who), game, state, who));
    }
    if (shown.includes("course")) this.foresight.look();
    return { ...this.found, course: shown.includes("course") ? this.foresight.course : null };
  }
}
