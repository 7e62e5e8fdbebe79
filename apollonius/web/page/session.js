// A person's time with the page: a match is chosen, counted in, played, paused, over, and looked back at.

import { asChoice, asQuery } from "./choices.js";
import { findGame } from "./files.js";
import { ACTIONS, EVADER, ROLES, bodiesOf, isActive, other } from "./game.js";
import { SlowReplay, hasCrashed, lastBrake, lastChance, standIn } from "./hindsight.js";
import { keepBest, levelWonBy, ofLevel } from "./levels.js";
import { Match } from "./match.js";
import { findTeam, shielded } from "./players.js";
import { YOU, bare, describeBrake, describeChance, describeEnd, describeReady } from "./words.js";

const LONGEST_PAUSE = 0.25; // of the clock, when a browser held frames back [s]
const COUNTDOWN = 1.5; // before a person's game continues [s]
const MOST_STEPS = 30; // in a frame
const BEAT = 0.5; // of the countdown [s]
const SPARE = 12; // of a frame after the game, to look back at it [ms]
const BRAKES = [1, 0, 2]; // the actions that brake, straight ahead first
const OUT = "You are out. Your team plays on.";

export class Session {
  /**
   * @param steer what a person does: from a side, and whether two people play, to an action
   * @param onChange called with a message when another phase begins, and during a countdown
   */
  constructor(steer, onChange) {
    Object.assign(this, { steer, onChange, catalogue: null, choice: null, match: null, phase: "loading", pace: 1 });
    this.#beginGame();
  }

  /** The sides that people play: each the first robot of its side. */
  get people() {
    return ROLES.filter((role) => this.match?.players[role][0].name === YOU);
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
    history.replaceState(null, "", asQuery(choice) + location.hash.replace(/^#replay=.*/, ""));
    this.enter("loading", "Loading…");
    try {
      const hasPerson = ROLES.filter((role) => choice[role] === YOU).length === 1;
      const difficulty = hasPerson ? choice.difficulty : "sharp";
      const steer = (role, ...seen) => {
        const wanted = this.steer(role, this.people.length === 2);
        return choice.level?.isGuarded ? shielded(() => [wanted, ...BRAKES, ...ACTIONS])(...seen)[0] : wanted;
      };
      const found = await findGame(this.catalogue, choice.game);
      const players = ROLES.map((role) => findTeam(this.catalogue, choice[role], role, bodiesOf(found, role).length, difficulty, steer));
      const [pursuer, evader] = await Promise.all(players);
      if (this.choice !== choice) return;
      const game = choice.level ? ofLevel(found, choice.level) : found;
      this.match = new Match(game, { pursuer, evader }, choice.seed);
      this.#makeReady();
    } catch (error) {
      if (this.choice === choice) this.enter("loading", `${error.message}. Choose otherwise under Games.`);
    }
  }

  /** Begin a game that has been played, to be played again. */
  watch(match) {
    Object.assign(this, { match, choice: { level: null } });
    this.#makeReady();
  }

  #beginGame() {
    Object.assign(this, { time: 0, counted: 0, ending: null, lostAt: null, hindsight: null });
  }

  #makeReady() {
    this.#beginGame();
    const { me, match, catalogue } = this;
    match.decide(); // so that no move waits for the arena's chart
    const isTaught = me && Object.hasOwn(catalogue.files, bare(match.players[other(me)][0].name).split(" ")[0]);
    this.enter("ready", describeReady(this.people.length, isTaught, Boolean(match.game.sensors)));
  }

  /** The one button: start, pause, go on, the next game or level. */
  go() {
    const { phase } = this;
    if (phase === "loading") return;
    if (phase === "playing" || phase === "counting") return this.enter("paused", "Paused");
    if (phase === "over") {
      const after = levelWonBy(this);
      if (after) return this.begin(asChoice(after));
      if (this.me && this.match.winner !== this.me) this.match.again();
      else this.match.next();
      this.#beginGame();
    }
    this.counted = this.people.length ? COUNTDOWN : 0;
    this.enter("counting");
  }

  /** The label of that button. */
  get label() {
    const { phase, match, me } = this;
    if (phase !== "over") return { counting: "Pause", playing: "Pause", paused: "Resume" }[phase] ?? "Start";
    if (levelWonBy(this)) return "Next level";
    return me && match.winner !== me ? "Try again" : "Next game";
  }

  /** Pause, if a game is under way. */
  pause() {
    if (this.phase === "playing" || this.phase === "counting") this.go();
  }

  /** Get ready for another game: `again` at the same start, `next` at another one. */
  begins(how) {
    this.match?.[how]();
    if (this.match) this.#makeReady();
  }

  /** Let some time [s] pass in the countdown or the match. */
  pass(seconds) {
    if (this.phase === "counting") this.#countDown(seconds);
    else if (this.phase === "playing") this.#advance(this.pace * Math.min(seconds, LONGEST_PAUSE));
    else if (this.phase === "over") this.#goBack();
  }

  /** Return whether the person's robot is out of play. */
  #isOut() {
    return this.me !== null && !isActive(this.match.state[this.me][0]);
  }

  #countDown(passed) {
    this.counted -= passed;
    if (this.counted <= 0) this.enter("playing", this.#isOut() ? OUT : "");
    else this.onChange(`${Math.ceil(this.counted / BEAT)}`);
  }

  /** As many steps as fit into the time. */
  #advance(passed) {
    const { match } = this;
    const { dt } = match.game;
    const wasOut = this.#isOut();
    this.time = Math.min(this.time + passed, MOST_STEPS * dt); // where steps are short, time passes more slowly
    while (this.time >= dt && !match.isOver) {
      match.step();
      this.time -= dt;
    }
    if (match.isOver) this.#finish();
    else if (this.#isOut() !== wasOut) this.enter("playing", OUT);
  }

  #finish() {
    const { match, me, choice } = this;
    const who = me && { role: me, number: 0 };
    this.isBest = choice.level && (choice.level.isEndless || match.winner === me) && keepBest(choice.level, match.seconds);
    this.ending = new SlowReplay(match);
    this.ending.play(Infinity, performance.now() / 1000);
    const hasLost = me && match.winner !== me;
    const brake = me && hasCrashed(match.state, who) ? lastBrake(match, who) : null;
    this.#tell(brake, describeBrake(match, brake));
    if (hasLost && !hasCrashed(match.state, who)) this.#lookBack(who);
  }

  /** Say how the game ended, and show it again from where it was lost, if that is known and no other moment is held. */
  #tell(lostAt, loss) {
    const { match, me, isBest, choice } = this;
    this.lostAt = lostAt;
    if (lostAt !== null && !this.ending.held && !this.ending.isFilmed) this.ending.play(lostAt, performance.now() / 1000);
    const best = isBest && (me === EVADER && !choice.level.isEndless ? "New under Games: this level, endless." : "Your best so far.");
    this.enter("over", [describeEnd(match, me, choice.level?.isEndless), loss, best].filter(Boolean).join(" "));
  }

  /** Begin to look for the moment when a game was lost; where nobody can take the person's place, nothing is said. */
  async #lookBack(who) {
    const { catalogue, match, ending } = this;
    const stand = await standIn(catalogue, match, who.role).catch(() => null);
    if (this.ending === ending && stand) this.hindsight = lastChance(match, who, stand);
  }

  #goBack() {
    const until = performance.now() + SPARE;
    while (this.hindsight && performance.now() < until) {
      const { done, value } = this.hindsight.next();
      if (!done) continue;
      this.hindsight = null;
      this.#tell(value, describeChance(this.match, this.me, value));
    }
  }
}
