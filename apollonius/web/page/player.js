// The page: buttons, keys and choices in, frames out. What is played is a `Session`.

import { Choices, asChoice, levelButtons } from "./choices.js";
import { Drawing } from "./drawing.js";
import { describeGo, describeGoal } from "./ending.js";
import { saveAs } from "./files.js";
import { EVADER, PURSUER } from "./game.js";
import { Controllers } from "./gamepad.js";
import { LAYERS } from "./layers.js";
import { withOpenFloor } from "./levels.js";
import { wordsOf } from "./match.js";
import { Session } from "./session.js";
import { Stage } from "./stage.js";
import { Steering } from "./steering.js";

const KEPT = 600; // durations

/** Durations [ms] of the last few hundred of something, and their 95th percentile. */
class Timing {
  constructor() {
    this.durations = [];
  }

  add(milliseconds) {
    this.durations.push(milliseconds);
    if (this.durations.length > KEPT) this.durations.shift();
  }

  /** Call a function and keep how long it took. */
  measure(work) {
    const begun = performance.now();
    const result = work();
    this.add(performance.now() - begun);
    return result;
  }

  get p95() {
    const sorted = this.durations.toSorted((a, b) => a - b);
    return sorted[Math.ceil(0.95 * sorted.length) - 1] ?? NaN;
  }
}

const element = (id) => document.getElementById(id);
const controllers = new Controllers();
const steering = new Steering(controllers);
const stage = new Stage(element, steering);
const timing = { frame: new Timing(), interval: new Timing(), move: new Timing() };
const measure = (work) => timing.move.measure(work);
const page = new Session((role, together) => steering.action(role, together), measure, showPhase);
let choices, drawing;
let isWhyShown = false;
globalThis.apollonius = { page, timing }; // for the console, and for tests

// ---- what is said of the session

function showPhase(message) {
  const { phase } = page;
  Object.assign(document.body.dataset, { phase, people: page.people.length, me: page.me ?? "" });
  element("message").textContent = message;
  element("go").textContent = describeGo(page);
  element("go").disabled = element("again").disabled = element("next").disabled = phase === "loading";
  element("download").disabled = phase !== "over";
  if (page.match) showScore(page);
}

function showScore({ match, choice, me }) {
  const number = choice.level ? `${choice.level.number}. ` : "";
  element("goal").textContent = number + describeGoal(match, me);
  for (const role of [PURSUER, EVADER]) {
    element(`${role}-name`).textContent = wordsOf(match.players[role]);
    element(`${role}-score`).textContent = match.score[role];
  }
}

// ---- what can be done: each of these is a button

const actions = {
  go: () => page.go(),
  again: () => page.again(),
  next: () => page.next(),
  menu() {
    page.pause();
    element("levels").replaceChildren(...levelButtons(page.choice?.level ?? null, (level) => choose(asChoice(level))));
    document.activeElement?.blur(); // so that Space and arrows are the game's again when the menu closes
    element("games").showModal();
  },
  play() {
    if (element("choices").reportValidity()) choose(choices.read());
  },
  why() {
    isWhyShown = !isWhyShown;
    element("why").setAttribute("aria-pressed", String(isWhyShown));
    showLayers();
  },
  draw: () => drawing.open(),
  "play-here": () => drawing.play(),
  back: () => page.again(),
  download() {
    const { match } = page;
    saveAs(`game-${match.number}-${match.outcome}.json`, JSON.stringify(match.replay()), "application/json");
  },
};

function choose(choice) {
  element("games").close();
  page.begin(choice);
}

function showLayers() {
  stage.layers = isWhyShown ? [...element("layers").querySelectorAll(":checked")].map(({ name }) => name) : [];
}

// ---- frames

let last = null;

function frame(now) {
  requestAnimationFrame(frame);
  const passed = last === null ? 0 : (now - last) / 1000;
  last = now;
  if (!page.match) return;
  if (page.phase === "drawing") return drawing.draw(stage.colours);
  if (controllers.starts() && !element("games").open) page.go();
  if (page.phase === "playing") timing.interval.add(1000 * passed);
  timing.frame.measure(() => {
    page.pass(passed);
    stage.show(page, now / 1000);
  });
}

// ---- wiring

function onKey(event) {
  const isDown = event.type === "keydown";
  const isGone = event.target.closest?.("dialog:not([open])"); // a button of the list that has just closed still has the keys
  const on = (elements) => !isGone && event.target.closest?.(elements);
  if (page.phase === "drawing" && isDown && !on("input") && drawing.key(event)) event.preventDefault();
  if (page.phase === "drawing" || event.ctrlKey || event.metaKey || event.altKey || element("games").open) return;
  if (isDown && (on("select, input") || (event.code === "Space" && on("button, summary")))) return;
  const pressed = { Space: actions.go, KeyR: actions.again, KeyN: actions.next, KeyV: actions.why }[event.code];
  if (steering.key(event.code, isDown) || pressed) event.preventDefault();
  if (isDown && !event.repeat) pressed?.();
}

/** A box to tick for each layer. */
function offerLayers() {
  const boxes = Object.entries(LAYERS).map(([name, words]) => {
    const [label, box] = ["label", "input"].map((kind) => document.createElement(kind));
    Object.assign(box, { type: "checkbox", name, checked: true });
    label.className = "check";
    label.append(box, words);
    return label;
  });
  element("layers").append(...boxes);
  element("layers").addEventListener("change", showLayers);
}

function wire() {
  offerLayers();
  for (const [id, action] of Object.entries(actions)) {
    element(id).addEventListener("click", (event) => {
      action();
      if (event.detail > 0) event.currentTarget.blur(); // pressed by a pointer, so Space is the game's again
    });
  }
  for (const type of ["keydown", "keyup"]) document.addEventListener(type, onKey);
  globalThis.addEventListener("blur", () => steering.release());
  globalThis.addEventListener("hashchange", () => location.reload());
  document.addEventListener("visibilitychange", () => document.hidden && page.pause());
  element("games").addEventListener("close", () => document.activeElement?.blur());
  element("choices").addEventListener("submit", (event) => {
    event.preventDefault();
    actions.play();
  });
  element("speed").addEventListener("change", ({ target }) => {
    page.pace = Number(target.value);
    target.blur();
  });
  element("moment").addEventListener("input", ({ target }) => page.look(Number(target.value)));
  element("moment").addEventListener("pointerup", ({ target }) => target.blur());
  for (const role of [PURSUER, EVADER]) steering.attach(element(`pad-${role}`), role);
}

async function main() {
  page.enter("loading", "Loading…");
  const catalogue = await (await fetch("catalogue.json")).json();
  page.catalogue = { ...catalogue, games: withOpenFloor(catalogue.games) };
  choices = new Choices(element("choices"), catalogue, page.catalogue.games);
  drawing = new Drawing(element, page, choices);
  wire();
  requestAnimationFrame(frame);
  const unplayable = await drawing.offerLinked(location.hash);
  const [choice, unknown] = choices.fromAddress(location.search, page.catalogue.games.drawn && "drawn");
  await page.begin(choice);
  if (page.match && (unplayable ?? unknown)) element("message").textContent = unplayable ?? unknown;
}

main().catch((error) => page.enter("loading", `This page cannot start: ${error.message}`));
