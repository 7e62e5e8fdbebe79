// A person's games: what is chosen, who plays, the phase that a game is in, and how much of its clock has passed.

import { asChoice, asQuery } from "./choices.js";
import { describeBrake, describeChance, describeEnd, describeLost, describeReady } from "./ending.js";
import { findGame } from "./files.js";
import { ROLES, countsOf, isActive } from "./game.js";
import { lastChance, standIns } from "./hindsight.js";
import { Coach } from "./hints.js";
import { Insight, hasCrashed, lastBrake } from "./insight.js";
import { challengeOf, keepBest, lasting, levelWonBy } from "./levels.js";
import { Match } from "./match.js";
import { isPerson } from "./names.js";
import { findTeam, rehearse } from "./players.js";
import { SlowReplay } from "./replaying.js";

const LONGEST_PAUSE = 0.25; // of the clock, when a browser held frames back [s]
const COUNTDOWN = 1.5; // before a person's game continues [s]
const MOST_STEPS = 30; // in a frame
const BEAT = 0.5; // of the countdown [s]
const SPARE = 12; // of a frame after the game, to look back at it [ms]

export class Session {
  /**
   * @param steer what a person does: from a side, and whether two people play, to an action
   * @param measure calls a function and keeps how long it took
   * @param onChange called with a message when another phase begins, and during a countdown
   */
  constructor(steer, measure, onChange) {
    Object.assign(this, { steer, measure, onChange, catalogue: null, choice: null, match: null, phase: "loading" });
    Object.assign(this, { time: 0, counted: 0, pace: 1, coach: null, insight: null });
    Object.assign(this, { ending: null, lostAt: null, hindsight: null, seen: null });
  }

  /** The sides that people play: each the first robot of its side. */
  get people() {
    return ROLES.filter((role) => this.match && isPerson(this.match.players[role][0].name));
  }

  /** The side of the one person who plays, or null. */
  get me() {
    const { people } = this;
    return people.length === 1 ? people[0] : null;
  }

  /** Go to a phase: loading, ready, counting, playing, paused, over; drawing. */
  enter(phase, message = "") {
    this.phase = phase;
    this.onChange(message);
  }

  /** Begin a match as chosen. A later choice that comes while agents load takes the place of this one. */
  async begin(choice) {
    this.choice = choice;
    history.replaceState(null, "", asQuery(choice) + location.hash);
    this.enter("loading", "Loading…");
    try {
      const hasPerson = ROLES.filter((role) => isPerson(choice[role])).length === 1;
      const difficulty = hasPerson ? choice.difficulty : "sharp";
      const steer = (role) => this.#steer(role);
      const found = await findGame(this.catalogue, choice.game);
      const players = countsOf(found).map((count, side) => {
        const role = ROLES[side];
        return findTeam(this.catalogue, choice[role], role, count, difficulty, steer, this.measure);
      });
      const [pursuer, evader] = await Promise.all(players);
      if (this.choice !== choice) return;
      const game = choice.level ? lasting(found, choice.level.seconds) : found;
      this.match = new Match(game, { pursuer, evader }, choice.seed);
      this.coach = choice.level?.number === 1 ? new Coach() : null;
      rehearse(this.match);
      this.#makeReady();
    } catch (error) {
      if (this.choice === choice) this.enter("loading", `${error.message}. Choose otherwise under Games.`);
    }
  }

  #steer(role) {
    const action = this.steer(role, this.people.length === 2);
    if (role === this.me) this.coach?.see(action);
    return action;
  }

  #beginGame() {
    Object.assign(this, { time: 0, counted: 0, insight: new Insight(this.match) });
    Object.assign(this, { ending: null, lostAt: null, hindsight: null, seen: null });
  }

  #makeReady() {
    this.#beginGame();
    this.enter("ready", describeReady(this.people.length));
  }

  /** The one button: start, pause, go on, the next game or level. */
  go() {
    const { phase } = this;
    if (phase === "loading") return;
    if (phase === "playing" || phase === "counting") return this.enter("paused", "Paused");
    if (phase === "over") {
      const after = levelWonBy(this, this.me);
      if (after) return this.begin(asChoice(after));
      this.match.next();
      this.#beginGame();
    }
    this.counted = this.people.length ? COUNTDOWN : 0;
    this.enter("counting");
  }

  /** Pause, if a game is under way. */
  pause() {
    if (this.phase === "playing" || this.phase === "counting") this.go();
  }

  /** Begin again at the same start. */
  again() {
    this.match?.again();
    if (this.match) this.#makeReady();
  }

  /** Another start. */
  next() {
    this.match?.next();
    if (this.match) this.#makeReady();
  }

  /** Let some time [s] pass in the countdown or the match. */
  pass(seconds) {
    if (this.phase === "counting") this.#countDown(seconds);
    else if (this.phase === "playing") this.#advance(Math.min(seconds, LONGEST_PAUSE) * (this.people.length ? 1 : this.pace));
    else if (this.phase === "over") this.#goBack();
  }

  #countDown(passed) {
    this.counted -= passed;
    if (this.counted <= 0) this.enter("playing", describeLost(this.match, this.me));
    else this.onChange(`${Math.ceil(this.counted / BEAT)}`);
  }

  /** As many steps as fit into the time. */
  #advance(passed) {
    const { match, me } = this;
    const { dt } = match.game;
    const isOut = () => me && !isActive(match.state[me][0]);
    const wasOut = isOut();
    this.time = Math.min(this.time + passed, MOST_STEPS * dt); // where steps are short, time passes more slowly
    while (this.time >= dt && !match.isOver) {
      match.step();
      this.time -= dt;
    }
    if (match.isOver) this.#finish();
    else if (isOut() !== wasOut) this.enter("playing", describeLost(match, me));
  }

  #finish() {
    const { match, me } = this;
    const who = me && { role: me, number: 0 };
    this.isBest = me && keepBest(challengeOf(this.choice), match, me);
    this.ending = new SlowReplay(match);
    this.ending.play(Infinity, performance.now() / 1000);
    const brake = me && lastBrake(match, who);
    this.#tell(brake, describeBrake(match, brake));
    if (me && match.winner !== me && !hasCrashed(match.state, who)) this.#lookBack(who);
  }

  /** Say how the game ended, and show it again from where it was lost, if that is known and no other moment is held. */
  #tell(lostAt, loss) {
    const { match, me, isBest } = this;
    this.lostAt = lostAt;
    if (lostAt !== null && !this.seen) this.ending.play(lostAt, performance.now() / 1000);
    const best = isBest && (match.winner === me ? "Your best so far." : "Your longest so far.");
    this.enter("over", [describeEnd(match, me), loss, best].filter(Boolean).join(" "));
  }

  /** Begin to look for the moment when a game was lost; where nobody can take the person's place, nothing is said. */
  async #lookBack(who) {
    const { catalogue, match, ending } = this;
    const stands = await standIns(catalogue, match, who).catch(() => []);
    if (this.ending === ending && stands.length) this.hindsight = lastChance(match, who, stands);
  }

  #goBack() {
    const until = performance.now() + SPARE;
    while (this.hindsight && performance.now() < until) {
      const { done, value } = this.hindsight.next();
      if (!done) continue;
      this.hindsight = null;
      this.#tell(value.number, describeChance(this.match, this.me, value));
    }
  }

  /** Hold a moment of the game that is over, by the number of its state. */
  look(number) {
    const match = this.match.from(number);
    this.ending.hold(number);
    this.seen = { match, insight: new Insight(match) };
  }
}
