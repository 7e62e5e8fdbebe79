// The page: choices, buttons and keys in, frames out. A match runs at the rules' own clock, drawing at the screen's.

import { BUILT_IN, atBest, shielded } from "./agents.js";
import { between, draw } from "./draw.js";
import { findAgent, findGame } from "./files.js";
import { Match, describeEnd } from "./match.js";
import { EVADER, PURSUER } from "./rules.js";
import { HOLD, Steering } from "./steering.js";
import { Timing } from "./timing.js";

const ROLES = [PURSUER, EVADER];
const YOU = "you";
const SHIELDED = "shielded:";
const LONGEST_PAUSE = 0.25; // of the clock, when a browser held frames back [s]
const REHEARSALS = 60; // moves before the first that counts, so that the browser has compiled them

const element = (id) => document.getElementById(id);
const steering = new Steering();
const timing = { frame: new Timing(), interval: new Timing(), move: new Timing() };
const page = { catalogue: null, match: null, phase: "loading", time: 0, last: null, colours: null };
globalThis.apollonius = { page, timing }; // for the console, and for tests

// ---- players

async function findPlayer(name, role) {
  if (name === YOU) return { name, act: () => steering.action(role, bothArePeople()) };
  const bare = name.replace(SHIELDED, "");
  const player = BUILT_IN[bare] ?? atBest(await findAgent(page.catalogue, bare));
  const rank = name.startsWith(SHIELDED) ? shielded(player) : player;
  return { name, rehearse: rank, act: (...seen) => timing.move.measure(() => rank(...seen)[0]) };
}

function rehearse({ game, state, players }) {
  for (const role of ROLES) {
    for (let move = 0; move < REHEARSALS; move++) players[role].rehearse?.(game, state, role);
  }
}

const isPerson = (role) => page.match?.players[role].name === YOU;
const people = () => ROLES.filter(isPerson);
const bothArePeople = () => people().length === 2;

// ---- choices

function offer(select, groups) {
  select.replaceChildren(
    ...groups.map(([label, names]) => {
      const group = document.createElement("optgroup");
      group.label = label;
      group.append(...names.map((name) => new Option(name, name)));
      return group;
    }),
  );
}

function offerChoices({ games, agents, chosen }) {
  offer(element("game"), [["arenas", Object.keys(games)]]);
  for (const role of ROLES) {
    const names = agents[role];
    offer(element(role), [
      ["a person", [YOU]],
      ["trained", names],
      ["trained, behind a shield", names.map((name) => SHIELDED + name)],
      ["built in", Object.keys(BUILT_IN)],
    ]);
  }
  const wanted = { ...chosen, ...Object.fromEntries(new URLSearchParams(location.search)) };
  for (const [name, value] of Object.entries(wanted)) {
    const field = element("choices").elements.namedItem(name);
    if (field) field.value = value;
    if (field && !field.value) field.value = chosen[name];
  }
}

/** Begin a match as chosen. A later choice that comes while agents load takes the place of this one. */
async function beginMatch() {
  const form = element("choices");
  if (!form.reportValidity()) return;
  const choice = Object.fromEntries(new FormData(form));
  history.replaceState(null, "", `?${new URLSearchParams(choice)}`);
  page.choice = choice;
  enter("loading", "Loading…");
  try {
    const players = ROLES.map((role) => findPlayer(choice[role], role));
    const [game, pursuer, evader] = await Promise.all([findGame(page.catalogue, choice.game), ...players]);
    if (page.choice !== choice) return;
    page.match = new Match(game, { pursuer, evader }, Number(choice.seed));
    rehearse(page.match);
    makeReady();
  } catch (error) {
    if (page.choice === choice) enter("loading", `${error.message}. Choose another player.`);
  }
}

// ---- phases: loading, ready, playing, paused, over

function enter(phase, message = "") {
  page.phase = phase;
  element("message").textContent = message;
  element("go").textContent = { playing: "Pause", paused: "Go on", over: "Next game" }[phase] ?? "Start";
  element("go").disabled = phase === "loading";
  element("again").disabled = element("next").disabled = phase === "loading";
  element("download").disabled = phase !== "over";
  showScore();
}

function makeReady() {
  page.time = 0;
  const touch = matchMedia("(pointer: coarse)").matches;
  const how = people().length ? (touch ? "hold the pad to steer" : "arrow keys to steer") : "two agents play";
  enter("ready", `${touch ? "Start" : "Space"} to begin; ${how}`);
}

const actions = {
  go() {
    if (page.phase === "playing") return enter("paused", "Paused");
    if (page.phase === "over") {
      page.match.next();
      page.time = 0;
    }
    if (page.phase !== "loading") enter("playing");
  },
  again() {
    page.match?.again();
    if (page.match) makeReady();
  },
  next() {
    page.match?.next();
    if (page.match) makeReady();
  },
  download() {
    const { match } = page;
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([JSON.stringify(match.replay())], { type: "application/json" }));
    link.download = `game-${match.number}-${match.outcome}.json`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  },
};

function showScore() {
  const { match } = page;
  if (!match) return;
  for (const role of ROLES) element(`${role}-name`).textContent = match.players[role].name;
  for (const [who, count] of Object.entries(match.score)) element(`${who}-score`).textContent = count;
}

// ---- frames

function frame(now) {
  requestAnimationFrame(frame);
  const passed = page.last === null ? 0 : (now - page.last) / 1000;
  page.last = now;
  if (!page.match) return;
  if (page.phase === "playing") timing.interval.add(1000 * passed);
  timing.frame.measure(() => {
    if (page.phase === "playing") advance(Math.min(passed, LONGEST_PAUSE));
    show();
  });
}

/** The match, as many steps on as fit into the time that has passed [s]. */
function advance(passed) {
  const { match } = page;
  page.time += passed;
  while (page.time >= match.game.dt && !match.isOver) {
    match.step();
    page.time -= match.game.dt;
  }
  if (match.isOver) enter("over", describeEnd(match));
}

/** Robots are drawn one step late, between the last two states, so that they move smoothly. */
function show() {
  const { match } = page;
  const [before, after] = match.states.slice(-2);
  const share = match.isOver ? 1 : page.time / match.game.dt;
  draw(
    element("canvas"),
    match.game,
    match.states,
    after && page.phase !== "ready" ? between(before, after, share) : match.state,
    page.colours,
    match.isOver ? [] : people(),
  );
  element("clock").textContent = match.seconds.toFixed(1);
  const action = people().length === 1 ? steering.action(people()[0], false) : HOLD;
  const cell = 3 * (2 - Math.floor(action / 3)) + (2 - (action % 3));
  [...element("pad").children].forEach((span, index) => span.classList.toggle("on", index === cell));
}

function showTiming() {
  const { frame, move } = timing;
  const milliseconds = (value) => `${value.toFixed(1)} ms`;
  const parts = [["a frame takes", frame], ["an agent's move", move]].filter(([, { p95 }]) => p95 >= 0);
  element("timing").textContent = parts.length
    ? `${parts.map(([what, { p95 }]) => `${what} ${milliseconds(p95)}`).join(", ")} (95th percentiles)`
    : "";
}

function readColours() {
  const style = getComputedStyle(document.documentElement);
  const names = ["paper", "ink", "obstacle", PURSUER, EVADER];
  page.colours = Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
}

// ---- wiring

function onKey(event) {
  const isDown = event.type === "keydown";
  const on = (elements) => event.target.closest?.(elements) !== null;
  const isTaken = on("select, input") || (event.code === "Space" && on("button, summary"));
  if (event.ctrlKey || event.metaKey || event.altKey || (isTaken && isDown)) return;
  const pressed = { Space: actions.go, KeyR: actions.again, KeyN: actions.next }[event.code];
  if (steering.key(event.code, isDown) || pressed) event.preventDefault();
  if (isDown && !event.repeat) pressed?.();
}

async function main() {
  readColours();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", readColours);
  for (const [id, action] of Object.entries(actions)) {
    element(id).addEventListener("click", (event) => {
      action();
      if (event.detail > 0) event.currentTarget.blur(); // pressed by a pointer, so Space is the game's again
    });
  }
  for (const type of ["keydown", "keyup"]) document.addEventListener(type, onKey);
  globalThis.addEventListener("blur", () => steering.release());
  document.addEventListener("visibilitychange", () => document.hidden && page.phase === "playing" && actions.go());
  element("choices").addEventListener("change", beginMatch);
  element("choices").addEventListener("submit", (event) => event.preventDefault());
  steering.attach(element("pad"));
  setInterval(showTiming, 1000);
  enter("loading", "Loading…");
  page.catalogue = await (await fetch("catalogue.json")).json();
  offerChoices(page.catalogue);
  requestAnimationFrame(frame);
  await beginMatch();
}

main().catch((error) => enter("loading", `This page cannot start: ${error.message}`));
