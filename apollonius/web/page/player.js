// The page: choices, buttons and keys in, frames out. A match runs at the rules' own clock, drawing at the screen's.

import { challengeOf, keepBest } from "./best.js";
import { Choices, asChoice, asQuery, levelButtons } from "./choices.js";
import { Coach } from "./coach.js";
import { Drawing } from "./drawing.js";
import { describeEnd, describeGo, describeGoal } from "./ending.js";
import { findGame, saveAs } from "./files.js";
import { Controllers } from "./gamepad.js";
import { Alarm, isTooFast, nearness } from "./hints.js";
import { lasting, levelWonBy, withOpenFloor } from "./levels.js";
import { Match } from "./match.js";
import { YOU } from "./names.js";
import { findPlayer, rehearse } from "./players.js";
import { SlowReplay } from "./replaying.js";
import { EVADER, PURSUER } from "./rules.js";
import { Stage } from "./stage.js";
import { HOLD, Steering } from "./steering.js";
import { Timing } from "./timing.js";

const ROLES = [PURSUER, EVADER];
const LONGEST_PAUSE = 0.25; // of the clock, when a browser held frames back [s]
const COUNTDOWN = 1.5; // before a person's game goes on [s]
const MOST_STEPS = 30; // in a frame
const BEAT = 0.5; // of it [s]

const element = (id) => document.getElementById(id);
const controllers = new Controllers();
const steering = new Steering(controllers);
const alarm = new Alarm();
const timing = { frame: new Timing(), interval: new Timing(), move: new Timing() };
const page = { catalogue: null, choices: null, choice: null, match: null, phase: "loading", time: 0, last: null };
Object.assign(page, { stage: new Stage(element, steering), counted: 0, pace: 1, coach: null, ending: null, complaint: null });
globalThis.apollonius = { page, timing }; // for the console, and for tests

// ---- who plays

const isPerson = (role) => page.match?.players[role].name === YOU;
const people = () => ROLES.filter(isPerson);
/** The side of the one person who plays, or null. */
const me = () => (people().length === 1 ? people()[0] : null);

function steer(role) {
  const action = steering.action(role, people().length === 2);
  if (role === me()) page.coach?.see(action);
  return action;
}

/** Begin a match as chosen. A later choice that comes while agents load takes the place of this one. */
async function beginMatch(choice) {
  history.replaceState(null, "", asQuery(choice) + location.hash);
  page.choice = choice;
  enter("loading", "Loading…");
  try {
    const hasPerson = ROLES.filter((role) => choice[role] === YOU).length === 1;
    const difficulty = hasPerson ? choice.difficulty : "sharp";
    const measure = (work) => timing.move.measure(work);
    const players = ROLES.map((role) => findPlayer(page.catalogue, choice[role], role, difficulty, steer, measure));
    const [found, pursuer, evader] = await Promise.all([findGame(page.catalogue, choice.game), ...players]);
    if (page.choice !== choice) return;
    const game = choice.level ? lasting(found, choice.level.seconds) : found;
    page.match = new Match(game, { pursuer, evader }, choice.seed);
    page.coach = choice.level?.number === 1 ? new Coach() : null;
    rehearse(page.match, HOLD);
    makeReady();
  } catch (error) {
    if (page.choice === choice) enter("loading", `${error.message}. Choose another player under Games.`);
    return;
  }
  if (page.complaint) {
    element("message").textContent = page.complaint;
    page.complaint = null;
  }
}

// ---- phases: loading, ready, counting, playing, paused, over; drawing

function enter(phase, message = "") {
  page.phase = phase;
  Object.assign(document.body.dataset, { phase, people: people().length, me: me() ?? "" });
  element("message").textContent = message;
  element("go").textContent = describeGo(phase, page, me());
  element("go").disabled = phase === "loading";
  element("again").disabled = element("next").disabled = phase === "loading";
  element("download").disabled = phase !== "over";
  showScore();
}

function makeReady() {
  Object.assign(page, { time: 0, ending: null, counted: 0 });
  const touch = matchMedia("(pointer: coarse)").matches;
  const how = people().length ? (touch ? "hold the pad to steer" : "arrow keys to steer") : "two agents play";
  enter("ready", `${touch ? "Start" : "Space"} to begin; ${how}`);
}

function finish() {
  const { match, choice } = page;
  let message = describeEnd(match, me());
  if (me() && keepBest(challengeOf(choice), match, me())) message += " Your best so far.";
  page.ending = new SlowReplay(match, performance.now() / 1000);
  enter("over", message);
}

const actions = {
  go() {
    const { phase } = page;
    if (phase === "loading") return;
    if (phase === "playing" || phase === "counting") return enter("paused", "Paused");
    if (phase === "over") {
      const after = levelWonBy(page, me());
      if (after) return beginMatch(asChoice(after));
      page.match.next();
      Object.assign(page, { time: 0, ending: null });
    }
    page.counted = people().length ? COUNTDOWN : 0;
    enter("counting");
  },
  again() {
    page.match?.again();
    if (page.match) makeReady();
  },
  next() {
    page.match?.next();
    if (page.match) makeReady();
  },
  menu() {
    if (page.phase === "playing" || page.phase === "counting") actions.go();
    element("levels").replaceChildren(...levelButtons(page.choice?.level ?? null, (level) => choose(asChoice(level))));
    document.activeElement?.blur(); // so that Space and arrows are the game's again when the menu closes
    element("games").showModal();
  },
  play() {
    if (element("choices").reportValidity()) choose(page.choices.read());
  },
  sound() {
    alarm.mute(!alarm.isMuted);
    element("sound").setAttribute("aria-pressed", String(!alarm.isMuted));
  },
  draw() {
    page.drawing.open();
  },
  "play-here"() {
    page.drawing.play();
  },
  back() {
    actions.again();
  },
  download() {
    const { match } = page;
    saveAs(`game-${match.number}-${match.outcome}.json`, JSON.stringify(match.replay()), "application/json");
  },
};

function choose(choice) {
  element("games").close();
  beginMatch(choice);
}

function showScore() {
  const { match, choice } = page;
  if (!match) return;
  const number = choice.level ? `${choice.level.number}. ` : "";
  element("goal").textContent = number + describeGoal(match, me());
  for (const role of ROLES) {
    element(`${role}-name`).textContent = match.players[role].words;
    element(`${role}-score`).textContent = match.score[role];
  }
}

// ---- frames

function frame(now) {
  requestAnimationFrame(frame);
  const passed = page.last === null ? 0 : (now - page.last) / 1000;
  page.last = now;
  if (!page.match) return;
  if (page.phase === "drawing") return page.drawing.workshop.draw(page.stage.colours);
  if (controllers.starts() && !element("games").open) actions.go();
  if (page.phase === "playing") timing.interval.add(1000 * passed);
  timing.frame.measure(() => {
    if (page.phase === "counting") countDown(passed);
    else if (page.phase === "playing") advance(Math.min(passed, LONGEST_PAUSE) * (people().length ? 1 : page.pace));
    page.stage.show(page, { people: people(), me: me() }, now / 1000);
    if (page.phase === "playing") warn(now / 1000);
  });
}

function countDown(passed) {
  page.counted -= passed;
  if (page.counted <= 0) return enter("playing");
  element("message").textContent = `${Math.ceil(page.counted / BEAT)}`;
}

function warn(now) {
  const { game, state } = page.match;
  if (me()) alarm.tell(nearness(game, state, me()), isTooFast(game, me(), state[me()]), now);
}

/** The match, as many steps on as fit into the time that has passed [s]. */
function advance(passed) {
  const { match } = page;
  page.time += passed;
  page.time = Math.min(page.time, MOST_STEPS * match.game.dt); // where steps are short, time passes more slowly
  while (page.time >= match.game.dt && !match.isOver) {
    match.step();
    page.time -= match.game.dt;
  }
  if (match.isOver) finish();
}

// ---- wiring

function onKey(event) {
  const isDown = event.type === "keydown";
  const on = (elements) => event.target.closest?.(elements) !== null;
  if (page.phase === "drawing" && isDown && !on("input") && page.drawing.workshop.key(event)) event.preventDefault();
  if (page.phase === "drawing" || event.ctrlKey || event.metaKey || event.altKey || element("games").open) return;
  if (isDown && (on("select, input") || (event.code === "Space" && on("button, summary")))) return;
  const pressed = { Space: actions.go, KeyR: actions.again, KeyN: actions.next, KeyM: actions.sound }[event.code];
  if (steering.key(event.code, isDown) || pressed) event.preventDefault();
  if (isDown && !event.repeat) pressed?.();
}

async function main() {
  for (const [id, action] of Object.entries(actions)) {
    element(id).addEventListener("click", (event) => {
      action();
      if (event.detail > 0) event.currentTarget.blur(); // pressed by a pointer, so Space is the game's again
    });
  }
  for (const type of ["keydown", "keyup"]) document.addEventListener(type, onKey);
  globalThis.addEventListener("blur", () => steering.release());
  document.addEventListener("visibilitychange", () => {
    if (document.hidden && ["playing", "counting"].includes(page.phase)) actions.go();
  });
  element("games").addEventListener("close", () => document.activeElement?.blur());
  element("choices").addEventListener("submit", (event) => {
    event.preventDefault();
    actions.play();
  });
  element("speed").addEventListener("change", ({ target }) => {
    page.pace = Number(target.value);
    target.blur();
  });
  for (const role of ROLES) steering.attach(element(`pad-${role}`), role);
  enter("loading", "Loading…");
  const catalogue = await (await fetch("catalogue.json")).json();
  page.catalogue = { ...catalogue, games: withOpenFloor(catalogue.games) };
  page.choices = new Choices(element("choices"), catalogue, page.catalogue.games);
  page.drawing = new Drawing(element, page, () => enter("drawing"), beginMatch);
  requestAnimationFrame(frame);
  globalThis.addEventListener("hashchange", () => location.reload());
  page.complaint = await page.drawing.offerLinked(location.hash);
  await beginMatch(page.choices.fromAddress(location.search, page.catalogue.games.drawn && "drawn"));
}

main().catch((error) => enter("loading", `This page cannot start: ${error.message}`));
