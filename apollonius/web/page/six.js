// A lesson as it is seen: six small arenas side by side, under each what becomes of its game, and the curve of the training.

import { draw, stateAt } from "./draw.js";
import { make } from "./files.js";
import { asTime } from "./words.js";

const CAUGHT = "captured";
const ZOOM = 1.5; // of the robots in small arenas
const [WIDTH, HEIGHT] = [400, 170]; // of the curve's drawing
const [LEFT, RIGHT, TOP, BOTTOM] = [48, 96, 14, 26]; // around the curve in it
const LABEL = 31; // width of a label
const SVG = "http://www.w3.org/2000/svg";

/** What has become of a game, from the view of its pursuer. */
function describe({ outcome, seconds }) {
  const ends = {
    ongoing: "hunts",
    [CAUGHT]: `caught: ${asTime(seconds)}`,
    pursuer_hit_obstacle: `hit a pillar: ${asTime(seconds)}`,
    pursuer_out_of_range: `hit the wall: ${asTime(seconds)}`,
    no_result: "did not arrive",
  };
  return ends[outcome] ?? `blue crashed: ${asTime(seconds)}`;
}

export class Six {
  /** @param element finds a part of the page by its id; `onChoice` is called with the name of the pursuer that a person wants to play against */
  constructor(element, onChoice) {
    Object.assign(this, { element, onChoice, lesson: null, views: [] });
  }

  /** Make a lesson's arenas and its curve. */
  open(lesson) {
    this.lesson = lesson;
    this.views = lesson.record.pupils.map(({ name, label }) => {
      const [canvas, end, tally] = [make("canvas", { ariaHidden: "true" }), make("span"), make("small")];
      const button = make("button", { title: "Play against this red", onclick: () => this.onChoice(name) }, canvas, make("strong", {}, label), end, tally);
      return { canvas, button, end, tally };
    });
    this.element("six").replaceChildren(...this.views.map(({ button }) => button));
    this.showCurve(lesson.record);
  }

  /** Show the curve of a training, of which `blue` says whom the pursuers hunt. */
  showCurve(record) {
    this.element("curve").replaceChildren(...curveOf(record));
    this.element("curve").setAttribute("aria-label", inWords(record));
    this.element("curve-about").textContent = aboutOf(record);
  }

  /** Draw a lesson as it is now. */
  show(colours) {
    const { lesson } = this;
    lesson.matches.forEach((match, index) => {
      const { canvas, button, end, tally } = this.views[index];
      const last = match.states.length - 1;
      const at = match.isOver ? last : Math.max(0, last - 1 + lesson.time / match.game.dt);
      draw(canvas, { ...match, at, colours, zoom: ZOOM });
      const said = describe(match);
      if (end.textContent !== said) end.textContent = said;
      tally.textContent = lesson.rounds ? `${match.score.pursuer} of ${lesson.rounds}` : "";
      button.dataset.outcome = match.isOver ? (match.outcome === CAUGHT ? "caught" : "lost") : "";
    });
  }
}

const svg = (kind, attributes, ...inside) => {
  const made = document.createElementNS(SVG, kind);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...inside);
  return made;
};

const asPercent = (share) => `${Math.round(100 * share)}\u00a0%`;

/** Return the curve of a training as an image's elements: the share of blues caught by env steps, with a dot for each pursuer. */
function curveOf({ curve, pupils, blue }) {
  const most = curve.at(-1).env_steps;
  const x = (steps) => LEFT + (WIDTH - LEFT - RIGHT) * Math.sqrt(steps / most); // as most is learned early
  const y = (share) => HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * share;
  const text = (left, top, words, more = {}) => svg("text", { x: left, y: top, ...more }, words);
  const grid = [0, 0.5, 1].flatMap((share) => [
    svg("line", { x1: LEFT, x2: WIDTH - RIGHT, y1: y(share), y2: y(share), class: "grid" }),
    text(LEFT - 6, y(share) + 4, asPercent(share), { "text-anchor": "end" }),
  ]);
  const points = curve.map((point) => `${x(point.env_steps).toFixed(1)},${y(point[blue]).toFixed(1)}`).join(" ");
  let free = 0; // of the line of labels, from here on
  const dots = pupils.flatMap((pupil) => {
    const after = pupil.env_steps === null; // the training has gone on elsewhere
    const [left, top] = [after ? WIDTH - RIGHT + 22 : x(pupil.env_steps), y(pupil[blue])];
    const middle = Math.max(left, free);
    free = middle + LABEL;
    const below = after ? [] : [text(middle, HEIGHT - 8, pupil.label, { "text-anchor": "middle" })];
    const beside = after ? [text(left + 9, top + 4, pupil.label)] : [];
    return [svg("circle", { cx: left, cy: top, r: 5 }), ...below, ...beside];
  });
  return [...grid, svg("polyline", { points }), ...dots];
}

/** Say in words what the curve shows. */
const inWords = ({ pupils, blue }) => `Caught: ${pupils.map((pupil) => `${pupil.label}: ${asPercent(pupil[blue])}`).join(", ")}`;

const aboutOf = ({ games, seconds, blue, curve }) => {
  const many = games.toLocaleString("en");
  const steps = `${Math.round(curve.at(-1).env_steps / 1e6)} million`;
  return `Measured: of ${many} starts, how often ${blue === "still" ? "a blue that stands still" : "a blue that flees"} is caught within ${seconds} s, by share of a training of ${steps} env steps.`;
};
