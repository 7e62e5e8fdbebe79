// A series of games between two players, one game at a time: its course, its end, the score, and its replay.

import { asRecord } from "./files.js";
import { EVADER, PURSUER, drawStart, gears, isContinuous, makeRandom, other, step, winner } from "./rules.js";

const REPLAY_FORMAT = 1;
const REPLAY_TOLERANCE = 1e-5; // what the page's rules and the package's may differ by, as tests/web shows

const asRow = ({ pursuer: p, evader: e }) => [p.x, p.y, p.v, p.heading, e.x, e.y, e.v, e.heading];

export class Match {
  /**
   * @param game rules, as `apollonius.arenas.record.to_dict` writes them, a map with its field
   * @param players {pursuer, evader}: {name, isTold, act(game, state, role, states, told) -> action}; who is told sees
   *   what the other is about to do
   * @param seed of the starts
   */
  constructor(game, players, seed) {
    Object.assign(this, { game, players, seed });
    this.random = makeRandom(seed);
    this.number = 0;
    this.score = { [PURSUER]: 0, [EVADER]: 0, nobody: 0 };
    this.next();
  }

  /** Begin the next game, at a start of its own. */
  next() {
    this.start = drawStart(this.game, this.random);
    this.number += 1;
    this.again();
  }

  /** Begin the same game again. */
  again() {
    this.states = [this.start];
    this.actions = [];
    this.outcome = "ongoing";
  }

  get state() {
    return this.states[this.states.length - 1];
  }

  get isOver() {
    return this.outcome !== "ongoing";
  }

  get seconds() {
    return this.state.steps * this.game.dt;
  }

  /** Who won the game that is over: "pursuer", "evader" or null. On this page outliving the time limit is a win. */
  get winner() {
    const survived = this.outcome === "no_result" && !this.game.arena.territory;
    return survived ? EVADER : winner(this.game, this.outcome);
  }

  /** How long the game may still last [s]. */
  get secondsLeft() {
    return (this.game.max_steps - this.state.steps) * this.game.dt;
  }

  /** One step of `dt`: both players act, the rules judge. */
  step() {
    const { game, state, states, players } = this;
    const actions = {};
    // Who is told acts last; if both are, the pursuer is told.
    const order = players.pursuer.isTold ? [EVADER, PURSUER] : [PURSUER, EVADER];
    for (const role of order) actions[role] = players[role].act(game, state, role, states, actions[other(role)]);
    const after = step(game, state, actions);
    this.states.push(after.state);
    this.actions.push([actions.pursuer, actions.evader]);
    this.outcome = after.outcome;
    if (this.isOver) this.score[this.winner ?? "nobody"] += 1;
  }

  /** The game as a replay file of the package: `apollonius show FILE` plays it again. */
  replay() {
    const someContinuous = this.actions.flat().some(isContinuous);
    return {
      format: REPLAY_FORMAT,
      game: asRecord(this.game),
      pursuer: this.players.pursuer.name,
      evader: this.players.evader.name,
      seed: this.seed,
      games: this.number,
      index: this.number - 1,
      outcome: this.outcome,
      tolerance: REPLAY_TOLERANCE,
      actions: someContinuous ? this.actions.map((both) => both.map(gears)) : this.actions,
      states: this.states.map(asRow),
    };
  }
}
