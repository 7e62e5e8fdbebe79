// A person's time with the page: a match is chosen, counted in, played, paused, over, and looked back at.

import { openAttract } from "./attract.js";
import { asChoice, asQuery } from "./choices.js";
import { findGame } from "./files.js";
import { EVADER, ROLES, bodiesOf, isActive } from "./game.js";
import { Guard } from "./guard.js";
import { endOf, isCalm } from "./effects.js";
import { IMPACT, SlowReplay, hasCrashed, lastBrake, lastChance, standIn } from "./hindsight.js";
import { BLUES, openLesson } from "./lesson.js";
import { canBeEndless, keepBest, levelWonBy, ofLevel, startOf } from "./levels.js";
import { Match } from "./match.js";
import { findTeam } from "./players.js";
import { sound } from "./sound.js";
import { YOU, asTime, describeBrake, describeChance, describeEnd, describeReady } from "./words.js";

const LONGEST_PAUSE = 0.25; // of the clock, when a browser held frames back [s]
const COUNTDOWN = 1.5; // before a person's game continues [s]
const MOST_STEPS = 30; // in a frame
const SLOW = 0.5; // pace of scenarios, which last some seconds
const BEAT = 0.5; // of the countdown [s]
const SPARE = 12; // of a frame after the game, to look back at it [ms]
const SHARED = "shared"; // the name of the game of a link, among the games
const OUT = "You are out. Your team plays on.";

export class Session {
  /**
   * @param steer what a person does: from a side, and whether two people play, to an action
   * @param onChange called with a message when another phase begins, and during a countdown
   */
  constructor(steer, onChange) {
    Object.assign(this, { steer, onChange, catalogue: null, choice: null, match: null, lesson: null, guard: new Guard(), phase: "loading", pace: 1 });
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

  /** Go to a phase: loading, ready, counting, playing, paused, over; drawing; lesson, which has no others. */
  enter(phase, message = "") {
    this.phase = phase;
    this.onChange(message);
  }

  /** Begin a match as chosen, at a start of its own. A later choice that comes while agents load takes the place of this one. */
  async begin(choice, start = null) {
    Object.assign(this, { choice, lesson: null });
    history.replaceState(null, "", asQuery(choice) + location.hash.replace(/^#replay=.*/, ""));
    this.enter("loading", "Loading…");
    try {
      if (choice.level?.isLesson) return await this.#teach(choice);
      const hasPerson = ROLES.filter((role) => choice[role] === YOU).length === 1;
      const difficulty = hasPerson ? choice.difficulty : "sharp";
      const guard = new Guard(choice.level?.shields);
      const steer = (role, ...seen) => {
        const wanted = this.steer(role, this.people.length === 2);
        return guard.action(wanted, ...seen);
      };
      const found = await findGame(this.catalogue, choice.game);
      const players = ROLES.map((role) => findTeam(this.catalogue, choice[role], role, bodiesOf(found, role).length, difficulty, steer));
      const [pursuer, evader] = await Promise.all(players);
      if (this.choice !== choice) return;
      const game = choice.level ? ofLevel(found, choice.level) : found;
      this.match = new Match(game, { pursuer, evader }, choice.seed, start ?? (choice.level && startOf(game, choice.level)));
      if (choice.level?.task) this.match.next = this.match.again;
      this.guard = guard;
      this.#makeReady();
    } catch (error) {
      if (this.choice === choice) this.enter("loading", `${error.message}. Choose otherwise under Games.`);
    }
  }

  /** Begin a level's lesson. */
  async #teach(choice, blue = Object.keys(BLUES)[0]) {
    const lesson = await openLesson(this.catalogue, choice.level, blue);
    if (this.choice !== choice) return;
    Object.assign(this, { match: null, lesson });
    lesson.isPaused = isCalm();
    this.enter("lesson");
  }

  /** The other blue takes the place of the one in the lesson. */
  changeBlue() {
    const names = Object.keys(BLUES);
    return this.#teach(this.choice, names.find((name) => name !== this.lesson.blue));
  }

  /** Begin a game that has been played, to be played again. */
  watch(match, level = null) {
    Object.assign(this, { match, choice: { level } });
    this.#makeReady();
    if (!isCalm()) this.go();
  }

  /** Take the place of the person whose game was played again: the same start against the same opponent. */
  accept({ game, start, challenge }) {
    this.catalogue.games[SHARED] = game;
    return this.begin({ ...challenge.choice, game: SHARED }, start);
  }

  /** Watch the line that wins a scenario, against the opponent of the match; then it is the person's turn again. */
  watchLine() {
    const { match, choice, me } = this;
    const { line, hold } = choice.level;
    const act = (_game, _state, { number }, states) => line[number][Math.floor((states.length - 1) / hold)];
    const own = line.map(() => ({ name: "line", words: "the proved line", values: null, act }));
    const shown = new Match(match.game, { ...match.players, [me]: own }, 0, match.start);
    this.watch(Object.assign(shown, { next: shown.again, challenge: { choice, me, seconds: null } }), choice.level);
  }

  #beginGame() {
    Object.assign(this, { time: 0, counted: 0, ending: null, end: null, lostAt: null, hindsight: null, attract: null });
  }

  #makeReady() {
    this.#beginGame();
    const { me, match, guard, people, choice } = this;
    match.decide(); // so that no move waits for the arena's chart
    this.enter("ready", describeReady({ me, people: people.length, isFoggy: Boolean(match.game.sensors), isBusy: Boolean(match.game.movers), shields: guard.times, level: choice.level }));
    if (people.length && !isCalm() && !choice.level?.task) this.#attract(match);
  }

  /** Let agents play behind the start's card; where they cannot be loaded, nothing is seen. */
  async #attract(match) {
    const attract = await openAttract(this.catalogue, match.game).catch(() => null);
    if (this.match === match && this.phase === "ready") this.attract = attract;
  }

  /** The one button: start, pause, go on, the next game or level. */
  go() {
    const { phase, lesson } = this;
    if (phase === "loading") return;
    if (lesson) {
      lesson.isPaused = !lesson.isPaused;
      return this.enter("lesson");
    }
    if (phase === "playing" || phase === "counting") return this.enter("paused", "Paused");
    if (phase === "over") {
      if (this.match.challenge) return this.accept(this.match);
      const after = levelWonBy(this);
      if (after) return this.begin(asChoice(after));
      if (this.me && this.match.winner !== this.me) this.match.again();
      else this.match.next();
      this.#beginGame();
    }
    Object.assign(this, { counted: this.people.length ? COUNTDOWN : 0, attract: null });
    this.enter("counting");
  }

  /** The label of that button. */
  get label() {
    const { phase, match, me, lesson } = this;
    if (lesson) return lesson.isPaused ? "Resume" : "Pause";
    if (phase !== "over") return { counting: "Pause", playing: "Pause", paused: "Resume" }[phase] ?? "Start";
    if (match.challenge) return match.challenge.seconds === null ? "Your turn" : `Beat this: ${asTime(match.challenge.seconds)}`;
    if (levelWonBy(this)) return "Next level";
    return me && match.winner !== me ? "Try again" : "Next game";
  }

  /** Pause, if a game is under way. */
  pause() {
    const isPlaying = this.phase === "lesson" ? !this.lesson.isPaused : this.phase === "playing" || this.phase === "counting";
    if (isPlaying) this.go();
  }

  /** Get ready for another game: `again` at the same start, `next` at another one. */
  begins(how) {
    if (this.lesson) {
      this.lesson.begins(how);
      return this.enter("lesson");
    }
    this.match?.[how]();
    if (this.match) this.#makeReady();
  }

  /** Let some time [s] pass in the countdown or the match. */
  pass(seconds) {
    if (this.phase === "lesson") this.lesson.pass(seconds);
    else if (this.phase === "ready") this.attract?.pass(seconds);
    else if (this.phase === "counting") this.#countDown(seconds);
    else if (this.phase === "playing") this.#advance((this.choice.level?.task ? SLOW : 1) * this.pace * Math.min(seconds, LONGEST_PAUSE));
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
    this.ending.play(Infinity, performance.now() / 1000, IMPACT);
    this.end = endOf(match);
    if (me && match.winner === me) sound("won");
    else if (this.end) sound(this.end.isCapture ? "captured" : "crashed");
    const hasLost = me && match.winner !== me;
    const brake = me && hasCrashed(match.state, who) ? lastBrake(match, who) : null;
    this.#tell(brake, describeBrake(match, brake));
    if (hasLost && !hasCrashed(match.state, who)) this.#lookBack(who);
  }

  /** Say how the game ended, and show it again from where it was lost, if that is known and no other moment is held. */
  #tell(lostAt, loss) {
    const { match, me, isBest, choice } = this;
    this.lostAt = lostAt;
    const now = performance.now() / 1000;
    const left = Math.max(0, IMPACT - (this.ending.sinceEnd(now) ?? IMPACT)); // of the time for which the end stands still
    if (lostAt !== null && !this.ending.held && !this.ending.isFilmed) this.ending.play(lostAt, now, left);
    const best = isBest && (canBeEndless(choice.level) && !choice.level.isEndless ? "New under Games: this level, endless." : "Your best so far.");
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
