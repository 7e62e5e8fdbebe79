// A series of games between two sides, one game at a time: its course, its end, the score, and its replay.

import { step } from "./calls.js";
import { asRecord } from "./files.js";
import { EVADER, HOLD, PURSUER, actionLevels, asRow, bySide, isActive, isContinuous } from "./game.js";
import { asLists } from "./movers.js";
import { drawStart, makeRandom, withMovers } from "./starts.js";

const REPLAY_FORMAT = 1;
const REPLAY_TOLERANCE = 1e-4; // what states of the page and of the package come to differ by in a thousand steps, and some to spare

/** Return the name of a side: each of its players once, a person first. */
const nameOf = (players) => [...new Set(players.map(({ name }) => name))].join("+");

export class Match {
  /**
   * @param game rules, as `apollonius.arenas.file.to_dict` writes them, a map with its field
   * @param players {pursuer, evader}, lists of who plays each robot: {name, act(game, state, who, states) -> action}
   * @param seed of the starts
   * @param first the first start, if it is not drawn
   */
  constructor(game, players, seed, first = null) {
    Object.assign(this, { game, players, seed });
    this.random = makeRandom(seed);
    this.number = 0;
    this.score = { [PURSUER]: 0, [EVADER]: 0 };
    this.next(first);
  }

  /** Begin the next game, at a start of its own. */
  next(start = null) {
    this.start = withMovers(this.game, start ?? drawStart(this.game, this.random), this.random);
    this.number += 1;
    this.again();
  }

  /** Begin the same game again. */
  again() {
    this.states = [this.start];
    this.actions = [];
    this.outcome = "ongoing";
  }

  /** The match as it stood at one of its states, for others to play on; it keeps no score. */
  from(number, players = this.players) {
    const [states, actions] = [this.states.slice(0, number + 1), this.actions.slice(0, number)];
    const outcome = number < this.states.length - 1 ? "ongoing" : this.outcome;
    return Object.assign(Object.create(Match.prototype), this, { players, states, actions, outcome, score: {} });
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

  /** The winner of a game that is over: "pursuer", "evader" or null. On this page outliving the time limit is a win. */
  get winner() {
    const { game, outcome } = this;
    if (["captured", "evader_hit_obstacle", "evader_out_of_range"].includes(outcome)) return PURSUER;
    if (["pursuer_hit_obstacle", "pursuer_out_of_range", "territory_reached"].includes(outcome)) return EVADER;
    return outcome === "no_result" && (!game.arena.territory || game.reward.profile === "zero-sum") ? EVADER : null;
  }

  /** The time until the limit [s]. */
  get secondsLeft() {
    return (this.game.max_steps - this.state.steps) * this.game.dt;
  }

  /** What all robots do now, {pursuer, evader}; of those that are not in play it makes no difference. */
  decide() {
    const { game, state, states, players } = this;
    const act = (player, role, number) => (isActive(state[role][number]) ? player.act(game, state, { role, number }, states) : HOLD);
    return bySide((role) => players[role].map((player, number) => act(player, role, number)));
  }

  /** One step of `dt`: all players act, the rules judge. */
  step() {
    const actions = this.decide();
    const after = step(this.game, this.state, actions);
    this.states.push(after.state);
    this.actions.push([...actions.pursuer, ...actions.evader]);
    this.outcome = after.outcome;
    if (this.winner) this.score[this.winner] += 1;
  }

  /** The game as a replay file of the package: `apollonius show FILE` plays it again. */
  replay() {
    const someContinuous = this.actions.some((all) => all.some(isContinuous));
    return {
      format: REPLAY_FORMAT,
      game: asRecord(this.game),
      pursuer: nameOf(this.players.pursuer),
      evader: nameOf(this.players.evader),
      seed: this.seed,
      games: this.number,
      index: this.number - 1,
      outcome: this.outcome,
      tolerance: REPLAY_TOLERANCE,
      actions: someContinuous ? this.actions.map((all) => all.map(actionLevels)) : this.actions,
      states: this.states.map(asRow),
      ...(this.start.movers && { movers: asLists(this.game, this.start.movers) }),
    };
  }
}
