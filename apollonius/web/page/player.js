// The page: buttons, keys and choices in, frames out. What is played is a `Session`.

import { BLUES } from "./lesson.js";
import { Choices, asChoice, describeProgress, levelButtons, levelStrip } from "./choices.js";
import { copyLink, make, saveAs } from "./files.js";
import { ROLES } from "./game.js";
import { addScenarios, inRushHour, levelWonBy, withOpenFloor } from "./levels.js";
import { Session } from "./session.js";
import { Six } from "./six.js";
import { asReplayLink, drawCard, fromReplayLink, isLocal, record } from "./share.js";
import { toggleSound } from "./sound.js";
import { Stage } from "./stage.js";
import { Steering } from "./steering.js";
import { LAYERS } from "./why.js";
import { YOU, asTime, describeGoal, wordsOf } from "./words.js";
import { Workshop } from "./workshop.js";

const FLAT = 2; // times as wide as high: an arena that leaves a message no room

const element = (id) => document.getElementById(id);
const steering = new Steering();
const stage = new Stage(element, steering);
const page = new Session((role, together) => steering.action(role, together), showPhase);
const six = new Six(element, playAgainst);
let choices, workshop;
globalThis.apollonius = { page }; // for the console, and for tests

// ---- what is said of the session

function showPhase(message) {
  const { phase, match, choice, me, people, lesson } = page;
  Object.assign(document.body.dataset, { phase, people: people.length, me: me ?? "" });
  element("message").textContent = message;
  document.body.dataset.result = phase === "over" && me ? (match.winner === me ? "won" : "lost") : "";
  document.body.dataset.message = phase === "over" && isAbove(page.end, match.game.arena) ? "below" : "";
  element("go").textContent = page.label;
  element("go").disabled = element("again").disabled = element("next").disabled = phase === "loading";
  element("download").disabled = phase !== "over";
  element("line").hidden = phase !== "over" || !me || !choice.level?.task;
  element("next").hidden = Boolean(choice?.level?.task); // which has one start
  const share = pupils().findIndex(({ name }) => name === choice?.pursuer);
  element("learning").hidden = share < 0;
  element("six").hidden = element("let-blue").hidden = element("next-level").hidden = !lesson;
  element("training").hidden = !lesson && share < 0;
  if (phase !== "counting") element("strip").replaceChildren(...levelStrip(choice?.level ?? null, (level) => choose(asChoice(level))));
  if (lesson) return showLesson();
  if (!match) return;
  if (share >= 0) {
    const [output, input] = element("learning").children;
    output.textContent = pupils()[share].label;
    input.value = share;
    six.showCurve({ ...page.catalogue.learning, blue: Object.hasOwn(BLUES, choice.evader) ? choice.evader : "flee-aware" });
  }
  const { arena } = match.game;
  const aspect = (arena.x_max - arena.x_min) / (arena.y_max - arena.y_min);
  document.body.style.setProperty("--aspect", aspect > FLAT ? 1.2 : aspect);
  element("goal").textContent = (choice.level ? `${choice.level.number}. ` : "") + describeGoal(match, me, choice.level?.isEndless);
  for (const role of ROLES) {
    element(`${role}-name`).textContent = wordsOf(match.players[role]);
    element(`${role}-score`).textContent = match.score[role];
  }
}

/** Whether a game ended in the upper half of the arena, where the message would cover it. */
const isAbove = (end, { y_min, y_max }) => end !== null && end.y > (y_min + y_max) / 2;

const pupils = () => (page.catalogue?.learning.pupils ?? []).filter(({ env_steps }) => env_steps !== null);

function showLesson() {
  const { lesson } = page;
  if (six.lesson !== lesson) six.open(lesson);
  document.body.style.setProperty("--aspect", 1.5);
  element("goal").textContent = `${lesson.level.number}. Red learns to hunt; blue ${BLUES[lesson.blue]}`;
  element("let-blue").textContent = lesson.blue === "still" ? "Let blue flee" : "Let blue stand";
}

/** Leave a lesson, and play against one of its pursuers. */
function playAgainst(pursuer) {
  return page.begin({ pursuer, evader: YOU, game: page.lesson.level.game, difficulty: "sharp", seed: page.lesson.level.seed, level: null });
}

// ---- what can be done: each of these is a button

const actions = {
  go: () => page.go(),
  again: () => page.begins("again"),
  next: () => page.begins("next"),
  "let-blue": () => page.changeBlue(),
  line: () => page.watchLine(),
  "next-level": () => page.begin(asChoice(levelWonBy(page))),
  menu() {
    page.pause();
    element("levels").replaceChildren(...levelButtons(page.catalogue.games, stage.colours, page.choice?.level ?? null, (level) => choose(asChoice(level))));
    element("games-title").textContent = describeProgress();
    document.activeElement?.blur(); // so that Space and arrows are the game's again when the menu closes
    element("games").showModal();
  },
  sound: () => element("sound").setAttribute("aria-pressed", String(toggleSound())),
  why() {
    const isHidden = element("layers").toggleAttribute("hidden");
    element("why").setAttribute("aria-pressed", String(!isHidden));
    showLayers();
  },
  draw: () => workshop.open(),
  "play-here": () => workshop.play(),
  back: () => page.begins("again"),
  download() {
    const { match } = page;
    saveAs(`game-${match.number}-${match.outcome}.json`, JSON.stringify(match.replay()), "application/json");
  },
  show: () => share().catch((error) => (element("message").textContent = `Not shared: ${error.message}`)),
  film: () => film().catch((error) => (element("message").textContent = `No film: ${error.message}`)),
};

/** Copy a link that plays the game again, and save or hand on its picture. */
async function share() {
  const { match, choice, ending } = page;
  const text = element("message").textContent;
  ending.hold(ending.last); // as a picture shows how it ended
  stage.show(page, performance.now() / 1000);
  const home = location.href.split(/[?#]/)[0];
  const { level } = choice;
  const below = ["Apollonius: pursuit and evasion", level && `Level ${level.number}: ${level.name}`, page.me && `Beat this: ${asTime(match.seconds)}`];
  const lines = [...below, !isLocal(location) && home].filter(Boolean);
  const picture = new File([await drawCard(element("canvas"), text, lines, stage.colours)], "apollonius.png", { type: "image/png" });
  const url = home + (await asReplayLink(match, level));
  const shared = { title: "Apollonius", text, url, files: [picture] };
  if (matchMedia("(pointer: coarse)").matches && navigator.canShare?.(shared)) return navigator.share(shared);
  await copyLink(url);
  saveAs(picture.name, picture, picture.type);
  const here = isLocal(location) ? " It works on this computer only: apollonius play --site DIR makes a page for others." : "";
  element("message").textContent = `The picture is saved. The link that plays this game again is copied, and in the address bar.${here}`;
}

/** Show the whole game again, quickly, and save what is seen as a film. */
async function film() {
  const made = record(element("canvas"), page.ending.film(performance.now() / 1000));
  element("film").disabled = true;
  const video = await made.finally(() => (element("film").disabled = false));
  saveAs(`apollonius.${video.type.includes("mp4") ? "mp4" : "webm"}`, video, video.type);
}

function choose(choice) {
  element("games").close();
  page.begin(choice);
}

function showLayers() {
  stage.layers = [...document.querySelectorAll("#layers:not([hidden]) :checked")].map(({ name }) => name);
}

// ---- frames

let last = null;

function frame(now) {
  requestAnimationFrame(frame);
  const passed = last === null ? 0 : (now - last) / 1000;
  last = now;
  if (page.phase === "drawing") return workshop.editor.draw(stage.colours);
  if (page.phase !== "lesson" && !page.match) return;
  page.pass(passed);
  if (page.phase === "lesson") return six.show(stage.colours);
  stage.show(page, now / 1000);
}

// ---- wiring

function onKey(event) {
  const isDown = event.type === "keydown";
  const isGone = event.target.closest?.("dialog:not([open])"); // a button of the list that has just closed still has the keys
  const on = (elements) => !isGone && event.target.closest?.(elements);
  if (page.phase === "drawing" && isDown && !on("input") && workshop.editor.key(event)) event.preventDefault();
  if (page.phase === "drawing" || event.ctrlKey || event.metaKey || event.altKey || element("games").open) return;
  if (isDown && (on("select, input") || (event.code === "Space" && on("button, summary")))) return;
  const pressed = { Space: actions.go, KeyR: actions.again, KeyN: actions.next, KeyV: actions.why }[event.code];
  if (steering.key(event.code, isDown) || pressed) event.preventDefault();
  if (isDown && !event.repeat) pressed?.();
}

function wire() {
  for (const [name, words] of Object.entries(LAYERS)) {
    element("layers").append(make("label", { className: "line" }, make("input", { type: "checkbox", name, checked: true }), words));
  }
  element("layers").addEventListener("change", showLayers);
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
    choose(choices.read());
  });
  element("speed").addEventListener("change", ({ target }) => {
    page.pace = Number(target.value);
    target.blur();
  });
  element("learning").addEventListener("change", async ({ target }) => {
    target.blur();
    await page.begin({ ...page.choice, pursuer: pupils()[target.value].name });
    if (page.phase === "ready" && page.people.length === 0) page.go(); // who only watches need not press a button
  });
  element("moment").addEventListener("input", ({ target }) => page.ending.hold(Number(target.value)));
  element("moment").addEventListener("pointerup", ({ target }) => target.blur());
  for (const role of ROLES) steering.attach(element(`pad-${role}`), role);
}

/** In a frame of another page, lead to the same game on the whole screen. */
function leadOut() {
  if (self === top) return;
  const words = "The same game on the whole screen";
  Object.assign(element("lead"), { href: location.href, textContent: "⤢", ariaLabel: words, title: words, hidden: false });
  element("lead").addEventListener("click", ({ target }) => (target.href = location.href));
}

async function main() {
  page.enter("loading", "Loading…");
  page.catalogue = await (await fetch("catalogue.json")).json();
  const { games } = page.catalogue;
  Object.assign(games, { open: withOpenFloor(games.paper), "rush-hour": inRushHour(games.office) });
  addScenarios(page.catalogue);
  choices = new Choices(element("choices"), page.catalogue);
  workshop = new Workshop(element, page, choices);
  wire();
  leadOut();
  requestAnimationFrame(frame);
  let [linked, unplayable] = await workshop.offerLinked(location.hash);
  const [choice, unknown] = choices.fromAddress(location.search, linked);
  try {
    const watched = await fromReplayLink(location.hash);
    if (watched) return page.watch(watched);
  } catch (error) {
    unplayable ??= error.message;
  }
  await page.begin(choice);
  if (page.match && (unplayable ?? unknown)) element("message").textContent = unplayable ?? unknown;
}

main().catch((error) => page.enter("loading", `This page cannot start: ${error.message}`));
