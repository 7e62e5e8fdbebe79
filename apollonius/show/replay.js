// Draws a recorded game on a canvas and plays it. A game is the data of a replay file; its states are rows of
// x, y [m], v [m/s], heading [rad] of each pursuer, then of each evader. Of a game of teams there is `until` too: for
// each robot the first step at which it is out of play, or null. Needs `arena.js` of the web page.

import { circle, drawArena, drawTrail, path } from "./arena.js";

const MARK_SECONDS = 5; // between two dots on a trail
const MARGIN = 30; // pixels around the arena, for its scale
const TICK = 2; // metres between two figures of the scale
const ROBOT = 9; // pixels: radius of a robot's sign

/** The state at a step that need not be whole: positions in a straight line, headings the short way round. */
export function stateAt(states, step) {
  const before = Math.min(Math.floor(step), states.length - 1);
  const after = Math.min(before + 1, states.length - 1);
  const part = step - before;
  return states[before].map((value, column) => {
    let change = states[after][column] - value;
    if (column % 4 === 3) change -= 2 * Math.PI * Math.round(change / (2 * Math.PI));
    return value + part * change;
  });
}

/** All robots of a game in the order of its states: where in a row they begin, and their letter, in teams a number. */
export function robotsOf({ game, until }) {
  const team = (side, others, name) =>
    [null, ...(others ?? [])].map((_, number) => ({ side, mark: others?.length ? `${number + 1}` : name }));
  const robots = [...team("pursuer", game.teams?.pursuers, "P"), ...team("evader", game.teams?.evaders, "E")];
  return robots.map((robot, index) => ({ ...robot, column: 4 * index, until: until?.[index] ?? Infinity }));
}

/** What there is to say of a state: of two robots distance and speeds, of teams who is in play and how near they are. */
export function facts(replay, step) {
  const state = stateAt(replay.states, step);
  const robots = robotsOf(replay).filter(({ until }) => step < until);
  const [pursuers, evaders] = ["pursuer", "evader"].map((name) => robots.filter(({ side }) => side === name));
  const apart = ({ column: i }, { column: j }) => Math.hypot(state[j] - state[i], state[j + 1] - state[i + 1]);
  const distances = pursuers.flatMap((pursuer) => evaders.map((evader) => apart(pursuer, evader)));
  const distance = distances.length ? `distance ${Math.min(...distances).toFixed(2)} m` : "";
  const rest = replay.game.teams
    ? [`${pursuers.length} v ${evaders.length} in play`]
    : robots.map(({ side, column }) => `${side} ${state[column + 2].toFixed(2)} m/s`);
  return [distance, ...rest].filter(Boolean).join(" · ");
}

/** An outcome in words. */
export function inWords(outcome) {
  return outcome.replaceAll("_", " ");
}

/** From metres to pixels: the arena as large as fits, its y axis upwards. */
export function projection(arena, width, height) {
  const scale = Math.min(
    (width - 2 * MARGIN) / (arena.x_max - arena.x_min),
    (height - 2 * MARGIN) / (arena.y_max - arena.y_min),
  );
  return {
    scale,
    x: (metres) => MARGIN + (metres - arena.x_min) * scale,
    y: (metres) => MARGIN + (arena.y_max - metres) * scale,
  };
}

/** Draw a game as it stands at a step: the arena with its scale, trails, robots, and the reaches of a capture. */
export function drawGame(context, width, height, replay, step, colours) {
  const { game, states } = replay;
  const at = projection(game.arena, width, height);
  context.clearRect(0, 0, width, height);
  drawScale(context, game.arena, at, colours);
  drawArena(context, game.arena, at, colours, 2);
  const state = stateAt(states, step);
  const robots = robotsOf(replay);
  for (const robot of robots) drawSide(context, at, replay, step, state, robot, colours);
  context.strokeStyle = colours.pursuer;
  context.lineWidth = 1;
  context.setLineDash([2, 3]);
  for (const { side, column, until } of robots) {
    if (side === "evader" || step >= until) continue;
    circle(context, at.x(state[column]), at.y(state[column + 1]), game.capture_distance * at.scale).stroke();
  }
  context.setLineDash([]);
  for (const robot of robots) (step < robot.until ? drawRobot : drawCross)(context, at, state, robot, colours);
}

/** Figures along the edges, lines between them, and what of an arena is not shown. */
function drawScale(context, arena, at, colours) {
  const [left, right, top, bottom] = [at.x(arena.x_min), at.x(arena.x_max), at.y(arena.y_max), at.y(arena.y_min)];
  context.font = "12px system-ui, sans-serif";
  context.fillStyle = colours.quiet;
  context.strokeStyle = colours.grid;
  context.lineWidth = 1;
  context.textAlign = "center";
  context.textBaseline = "top";
  for (let metres = Math.ceil(arena.x_min / TICK) * TICK; metres <= arena.x_max; metres += TICK) {
    path(context, [[at.x(metres), top], [at.x(metres), bottom]]).stroke();
    context.fillText(metres + (metres + TICK > arena.x_max ? " m" : ""), at.x(metres), bottom + 7);
  }
  context.textAlign = "right";
  context.textBaseline = "middle";
  for (let metres = Math.ceil(arena.y_min / TICK) * TICK; metres <= arena.y_max; metres += TICK) {
    path(context, [[left, at.y(metres)], [right, at.y(metres)]]).stroke();
    context.fillText(metres, left - 7, at.y(metres));
  }
  if (arena.map) {
    context.textAlign = "left";
    context.fillText("the occupancy map of this arena is not shown here", left + 6, top + 12);
  }
}

/** A trail up to a step, with a dot every few seconds. */
function drawSide(context, at, replay, step, state, { side, column, until }, colours) {
  const { states, game } = replay;
  const driven = [...states.slice(0, Math.floor(Math.min(step, until)) + 1), state];
  const trail = driven.map((there) => [at.x(there[column]), at.y(there[column + 1])]);
  drawTrail(context, trail, colours[side], 2, 5, side === "evader" ? [6, 4] : []);
  const every = Math.round(MARK_SECONDS / game.dt);
  for (let index = every; index <= Math.min(step, until); index += every) circle(context, ...trail[index], 3.5).fill();
}

/** The sign of a robot that is out of play. */
function drawCross(context, at, state, { side, column }, colours) {
  const [x, y, reach] = [at.x(state[column]), at.y(state[column + 1]), 0.7 * ROBOT];
  context.strokeStyle = colours[side];
  context.lineWidth = 3;
  for (const slope of [1, -1]) path(context, [[x - reach, y - slope * reach], [x + reach, y + slope * reach]]).stroke();
}

function drawRobot(context, at, state, { side, column, mark }, colours) {
  const [x, y] = [at.x(state[column]), at.y(state[column + 1])];
  const heading = state[column + 3];
  context.fillStyle = context.strokeStyle = colours[side];
  context.lineWidth = 3;
  const nose = [x + 2 * ROBOT * Math.cos(heading), y - 2 * ROBOT * Math.sin(heading)];
  path(context, [[x, y], nose]).stroke();
  circle(context, x, y, ROBOT).fill();
  context.fillStyle = colours.paper;
  context.font = `bold ${ROBOT + 3}px system-ui, sans-serif`;
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.fillText(mark, x, y + 0.5);
}

/**
 * Plays games in the elements of a page. Inside `root` it looks for `canvas`, and by `data-part` for `play` and `pace`
 * (a button and a select: simulated seconds in a second), `seek` (a range), `clock`, `facts` and `outcome` (for text),
 * and for elements with `data-game`, each of which chooses the game of that index.
 */
export class ReplayPlayer {
  constructor(root, replays) {
    this.root = root;
    this.replays = replays;
    this.canvas = root.querySelector("canvas");
    this.part = (name) => root.querySelector(`[data-part="${name}"]`);
    this.playing = false;
    this.part("play").addEventListener("click", () => (this.playing ? this.pause() : this.play()));
    this.part("seek").addEventListener("input", (event) => {
      this.pause();
      this.show(Number(event.target.value));
    });
    this.choices = [...root.querySelectorAll("[data-game]")];
    for (const choice of this.choices) {
      choice.addEventListener("click", () => {
        this.choose(Number(choice.dataset.game));
        this.canvas.scrollIntoView({ block: "nearest" });
        this.play();
      });
    }
    new ResizeObserver(() => this.show(this.step)).observe(this.canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.show(this.step));
    this.choose(0);
  }

  /** Take up a game; it is shown at its end, with all trails. */
  choose(index) {
    this.pause();
    this.replay = this.replays[index];
    this.last = this.replay.states.length - 1;
    const { arena, dt } = this.replay.game;
    this.canvas.style.aspectRatio = `${arena.x_max - arena.x_min} / ${arena.y_max - arena.y_min}`;
    this.part("seek").max = this.last;
    this.part("outcome").textContent =
      `${this.replay.pursuer} against ${this.replay.evader}: ` +
      `${inWords(this.replay.outcome)} after ${(this.last * dt).toFixed(1)} s`;
    for (const choice of this.choices) choice.setAttribute("aria-pressed", String(Number(choice.dataset.game) === index));
    this.show(this.last);
  }

  /** Play on from here, or from the start if the game is at its end. */
  play() {
    if (this.step >= this.last) this.show(0);
    this.playing = true;
    this.part("play").textContent = "Pause";
    let before;
    const frame = (now) => {
      if (!this.playing) return;
      const seconds = before === undefined ? 0 : (now - before) / 1000;
      before = now;
      this.show(Math.min(this.last, this.step + (seconds * Number(this.part("pace").value)) / this.replay.game.dt));
      if (this.step >= this.last) this.pause();
      else requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  pause() {
    this.playing = false;
    this.part("play").textContent = "Play";
  }

  /** Show the game as it stands at a step, whole or not. */
  show(step) {
    this.step = step;
    const { width, height } = this.canvas.getBoundingClientRect();
    const ratio = devicePixelRatio || 1;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    const context = this.canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    const style = getComputedStyle(this.root);
    const names = ["pursuer", "evader", "obstacle", "ink", "paper", "grid", "quiet"];
    const colours = Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
    drawGame(context, width, height, this.replay, step, colours);
    const { dt } = this.replay.game;
    const clock = `${(step * dt).toFixed(1)} s of ${(this.last * dt).toFixed(1)} s`;
    this.part("seek").value = Math.round(step);
    this.part("seek").setAttribute("aria-valuetext", clock);
    this.part("clock").textContent = clock;
    this.part("facts").textContent = facts(this.replay, step);
  }
}
