// Fog: robots that see no further than walls and obstacles let them, what they know of their opponents, and how it is drawn.

import { CELLS, search } from "./calls.js";
import { circle, picture } from "./draw.js";
import { PURSUER, bySide, other } from "./game.js";

const FOG = 0.3; // how opaque it is
const RING = 0.32; // around where a robot was seen last [m]
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
 * @returns {rival, isHidden, last, credit}: the other side, whether its robot is out of sight, where it was seen last, or null, and
 *   in which cells it can be, as `search` says
 */
export function fogOf({ game, states, isOver }, me) {
  if (!me || isOver || !isFoggy(game, me)) return null;
  const found = knowledge(game, states, me);
  const isHidden = found.age > 0;
  return { rival: other(me), isHidden, last: isHidden && found.isSeen ? found.last : null, credit: found.credit };
}

/** Return functions that draw fog on the bare ground, and above it a dashed ring where the rival was seen last. */
export function veilOf(arena, { rival, isHidden, last, credit }, colours) {
  const beneath = (context) => isHidden && drawCells(context, arena, FOG, credit, colours);
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

/** Draw cells of an arena's chart, from the bottom: each in the colour that its value has, if any; dark where an opponent can be. */
export function drawCells(context, arena, opacity, values, colours, colourOf = (credit) => (credit < 0 ? null : colours.ink)) {
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
