// Fog: robots that see no further than walls and obstacles let them, what they know of their opponents, and how it is drawn.

import { CELLS, clearanceAlong, leads, search } from "./calls.js";
import { circle, path, picture } from "./draw.js";
import { PURSUER, bySide, other } from "./game.js";

const [FOG, HATCH] = [0.22, 0.4]; // how opaque it and its lines are
const APART = 0.022; // lines, as a share of the arena's side
const [RAYS, HALVES] = [360, 10]; // of a robot's sight, and how often the length of one is halved
const RING = 0.32; // around where a robot was seen last [m]
const walls = new WeakMap(); // by an arena: cells to whose middle no path leads, as it is too near a wall
const layers = new WeakMap(); // by what is known of a state: the picture of the fog
const memories = bySide(() => new WeakMap()); // by a state of a game: what the side's robot knows then

/** Return a game of two robots in fog. */
export const inFog = (game) => ({ ...game, sensors: bySide(() => ({ line_of_sight: true })) });

/** Return whether a side sees no further than obstacles let it. */
export const isFoggy = (game, role) => Boolean(game.sensors?.[role]);

/** What the robot of a side knows after the last of the states of a game, as `search` returns it. */
export function knowledge(game, states, role) {
  const memory = memories[role];
  for (let number = states.findLastIndex((state) => memory.has(state)) + 1; number < states.length; number++) {
    memory.set(states[number], search(game, states[number], { role, number: 0 }, memory.get(states[number - 1])));
  }
  return memory.get(states.at(-1));
}

/** Another player in fog: it sees the last sighting, and a pursuer that has none of late an opponent where one can be. */
export function bySight(player) {
  return (game, state, who, states) => {
    if (!isFoggy(game, who.role)) return player(game, state, who, states);
    const { last, sought } = knowledge(game, states, who.role);
    const [rival, seen] = [other(who.role), who.role === PURSUER ? sought : last];
    return player(game, { ...state, [rival]: [{ ...seen, status: state[rival][0].status }] }, who, states);
  };
}

/**
 * What a person sees of a match in fog, or null where all is seen.
 *
 * @returns {rival, isHidden, last, budget, own, blocked}: the other side, whether its robot is out of sight, where it was seen last,
 *   or null, in which cells it can be, as `search` says, the person's robot, and which cells have no path
 */
export function fogOf({ game, states, isOver }, me) {
  if (!me || isOver || !isFoggy(game, me)) return null;
  const found = knowledge(game, states, me);
  const isHidden = found.age > 0;
  if (!walls.has(game.arena)) walls.set(game.arena, leads(game, states[0]).map((lead) => Number(Number.isNaN(lead))));
  const last = isHidden && found.isSeen ? found.last : null;
  return { rival: other(me), isHidden, last, budget: found.budget, own: states.at(-1)[me][0], blocked: walls.get(game.arena) };
}

/** Return functions that draw fog on the bare ground, and above it a dashed ring where the rival was seen last. */
export function veilOf(arena, { rival, isHidden, last, ...known }, colours) {
  const beneath = (context) => isHidden && drawFog(context, arena, known, colours);
  const above = (context) => {
    if (!last) return;
    context.strokeStyle = colours[rival];
    context.lineWidth = 0.03;
    context.setLineDash([0.08, 0.1]);
    circle(context, last.x, last.y, RING).stroke();
    context.setLineDash([]);
  };
  return { beneath, above };
}

/** Cells where an opponent can be, and the ones beside walls next to them. */
function covered(budget, blocked) {
  let cover = Array.from(budget, (one) => one >= 0);
  const isBeside = (cell) => [-1, 1, -CELLS, CELLS].some((step) => cover[cell + step]);
  for (let ring = 0; ring < 2; ring++) cover = cover.map((is, cell) => is || (blocked[cell] > 0 && isBeside(cell)));
  return cover;
}

/** The outline of what a robot has in sight: along each ray as far as nothing is touched. */
function sightOf(arena, from) {
  const { x_min, x_max, y_min, y_max } = arena;
  const longest = Math.hypot(x_max - x_min, y_max - y_min);
  return Array.from({ length: RAYS }, (_, ray) => {
    const angle = (2 * Math.PI * ray) / RAYS;
    const at = (length) => ({ x: from.x + length * Math.cos(angle), y: from.y + length * Math.sin(angle) });
    let [free, touching] = [0, longest];
    for (let half = 0; half < HALVES; half++) {
      const middle = (free + touching) / 2;
      if (clearanceAlong(arena, from, at(middle)) > 0) free = middle;
      else touching = middle;
    }
    const { x, y } = at(touching);
    return [x, y];
  });
}

/** Draw fog: hatched, at the screen's own resolution, and nowhere in what the robot has in sight. */
function drawFog(context, arena, { budget, own, blocked }, colours) {
  const { width, height } = context.canvas;
  let layer = layers.get(budget);
  if (layer?.width !== width || layer.height !== height || layer.colours !== colours) {
    layer = Object.assign(new OffscreenCanvas(width, height), { colours });
    paintFog(layer.getContext("2d"), context.getTransform(), arena, covered(budget, blocked), sightOf(arena, own), colours);
    layers.set(budget, layer);
  }
  const { x_min, x_max, y_min, y_max } = arena;
  context.save();
  context.beginPath();
  context.rect(x_min, y_min, x_max - x_min, y_max - y_min);
  context.clip();
  context.resetTransform();
  context.drawImage(layer, 0, 0);
  context.restore();
}

function paintFog(context, transform, { x_min: x, x_max: right, y_min: y, y_max: top }, cover, sight, colours) {
  const side = Math.max(right - x, top - y);
  context.setTransform(transform);
  context.fillStyle = context.strokeStyle = colours.fog;
  context.globalAlpha = FOG;
  context.fillRect(x, y, side, side);
  context.globalAlpha = HATCH;
  context.lineWidth = 0.004 * side;
  for (let from = -side; from < side; from += APART * side) path(context, [[x + from, y], [x + from + side, y + side]]).stroke();
  context.globalAlpha = 1;
  context.globalCompositeOperation = "destination-in";
  context.resetTransform();
  context.drawImage(maskOf(context.canvas, transform, { x, y, side }, cover, sight), 0, 0);
}

/** A canvas that is full where there is fog. */
function maskOf({ width, height }, transform, { x, y, side }, cover, sight) {
  const context = new OffscreenCanvas(width, height).getContext("2d");
  const cell = side / CELLS;
  context.setTransform(transform);
  context.lineJoin = "round";
  context.lineWidth = 0.5 * cell; // rounds the corners
  context.beginPath();
  cover.forEach((is, at) => is && context.rect(x + cell * (at % CELLS), y + cell * Math.floor(at / CELLS), cell, cell));
  context.fill();
  context.stroke();
  context.globalCompositeOperation = "destination-out";
  path(context, sight).fill();
  return context.canvas;
}

/** Draw cells of an arena's chart, from the bottom: each in the colour that its value has, if any; dark where an opponent can be. */
export function drawCells(context, arena, opacity, values, colours, colourOf = (budget) => (budget < 0 ? null : colours.ink)) {
  const { x_min: x, x_max: right, y_min: y, y_max: top } = arena;
  const cell = Math.max(right - x, top - y) / CELLS;
  context.save();
  context.beginPath();
  context.rect(x, y, right - x, top - y);
  context.clip();
  context.globalAlpha = opacity;
  context.imageSmoothingEnabled = true;
  const canvas = picture(values, colours, CELLS, CELLS, (column, row) => colourOf(values[row * CELLS + column]));
  context.drawImage(canvas, x, y, cell * CELLS, cell * CELLS);
  context.restore();
}
