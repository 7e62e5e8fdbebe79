// A match under way on a canvas, from above: the arena, trails, robots. Lengths are in metres, y points up. The widths
// of lines are those of an arena of 10 m.

import { PURSUER, ROLES, bodyOf, bySide, isActive, moversOf, robotOf, robotsOf, wrapAngle } from "./game.js";

const SMALLEST = 0.015; // least radius of a robot's sign, as a share of the arena's longer side
const MARGIN = 0.35; // around the walls [m], where a robot without a radius is seen whole
const GLOWS = 3; // how long a trail glows behind its robot [s]
const PIECES = 24; // of a glowing trail
const LATEST = [[7, 0.1], [3.5, 0.22], [1.4, 0.9]]; // widths of light around a trail, each with its opacity
const MOST_PIXELS = 2048; // along a side of a map's picture; of a larger map some cells are left out
const pictures = new WeakMap(); // with their colours, by what they show

/** Colours by name, as a page's style has them just now for an element. */
export function coloursOf(element) {
  const style = getComputedStyle(element);
  const names = ["paper", "ink", "obstacle", "mover", "fog", ...ROLES];
  return Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
}

/** Return the state of a number, whole or between two. */
export function stateAt(states, number) {
  const [before, after, share] = [states[Math.floor(number)], states[Math.ceil(number)], number % 1];
  const mix = (a, b) => a + (b - a) * share;
  const robot = (start, end) => ({
    x: mix(start.x, end.x),
    y: mix(start.y, end.y),
    v: mix(start.v, end.v),
    heading: start.heading + share * wrapAngle(end.heading - start.heading),
    status: start.status,
  });
  const between = (key) => before.movers[key].map((one, place) => mix(one, after.movers[key][place]));
  const movers = before.movers && { movers: { motion_x: between("motion_x"), motion_y: between("motion_y") } };
  return { ...after, ...movers, ...bySide((role) => before[role].map((start, number) => robot(start, after[role][number]))) };
}

/** Return the `scale` of a canvas that shows an arena, in pixels per metre, and the pixel of the origin. */
export function placing(canvas, arena) {
  const [width, height] = [arena.x_max - arena.x_min + 2 * MARGIN, arena.y_max - arena.y_min + 2 * MARGIN];
  const scale = Math.min(canvas.width / width, canvas.height / height);
  const x = canvas.width / 2 - (scale * (arena.x_min + arena.x_max)) / 2;
  const y = canvas.height / 2 + (scale * (arena.y_min + arena.y_max)) / 2;
  return { scale, x, y };
}

/** Return the context of a canvas, cleared and scaled to the metres of an arena. */
export function scaled(canvas, arena) {
  const context = canvas.getContext("2d");
  const { scale, x, y } = placing(canvas, arena);
  context.resetTransform();
  context.clearRect(0, 0, canvas.width, canvas.height);
  context.setTransform(scale, 0, 0, -scale, x, y);
  context.lineJoin = context.lineCap = "round";
  return context;
}

/** Make a canvas as large as its place in the page; returns its context, cleared and scaled. */
export function begin(canvas, arena) {
  const ratio = globalThis.devicePixelRatio;
  const pixels = [canvas.clientWidth, canvas.clientHeight].map((length) => Math.max(1, Math.round(length * ratio)));
  if (canvas.width !== pixels[0] || canvas.height !== pixels[1]) [canvas.width, canvas.height] = pixels;
  return scaled(canvas, arena);
}

/** A circle, to be filled or stroked. */
export function circle(context, x, y, radius) {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  return context;
}

/** Lines from point to point, [x, y] each, to be filled or stroked. */
export function path(context, points) {
  context.beginPath();
  for (const [x, y] of points) context.lineTo(x, y);
  return context;
}

/** Two strokes through a point. */
export function cross(context, { x, y }, half) {
  for (const rise of [half, -half]) path(context, [[x - half, y - rise], [x + half, y + rise]]).stroke();
}

/** Obstacles, territory and walls of an arena. Cells of an occupancy map are left out. */
function drawArena(context, arena, colours) {
  context.fillStyle = colours.obstacle;
  for (const disc of arena.discs) circle(context, disc.x, disc.y, disc.radius).fill();
  for (const { vertices } of arena.polygons ?? []) path(context, vertices).fill();
  context.lineWidth = 0.05;
  if (arena.territory) {
    const { x, y, radius } = arena.territory;
    context.strokeStyle = colours.evader;
    circle(context, x, y, radius).stroke();
  }
  context.strokeStyle = colours.ink;
  context.strokeRect(arena.x_min, arena.y_min, arena.x_max - arena.x_min, arena.y_max - arena.y_min);
}

/** A picture of cells, a pixel each, by a function from column and row to a colour, if any; it is painted once for what it shows. */
export function picture(shown, colours, width, height, colourOf) {
  const painted = pictures.get(shown);
  if (painted?.colours === colours) return painted.canvas;
  const canvas = new OffscreenCanvas(width, height);
  const context = canvas.getContext("2d");
  for (let row = 0; row < height; row++) {
    for (let column = 0; column < width; column++) {
      const colour = colourOf(column, row);
      if (!colour) continue;
      context.fillStyle = colour;
      context.fillRect(column, row, 1, 1);
    }
  }
  pictures.set(shown, { colours, canvas });
  return canvas;
}

/** Draw the occupied cells of a map, the first row at the bottom, as lengths along y point up. */
function drawMap(context, map, colours) {
  const { field, rows, columns, cell } = map;
  const every = Math.ceil(Math.max(rows - 1, columns - 1) / MOST_PIXELS);
  const [width, height] = [columns - 1, rows - 1].map((count) => Math.ceil(count / every));
  const canvas = picture(map, colours, width, height, (column, row) => {
    const at = every * (row * columns + column);
    return field[at] + field[at + 1] + field[at + columns] + field[at + columns + 1] <= 0 && colours.obstacle;
  });
  context.imageSmoothingEnabled = false;
  context.drawImage(canvas, map.x, map.y, (columns - 1) * cell, (rows - 1) * cell);
}

/** The ground of an arena and what stands on it; `beneath` draws on the bare ground. */
export function drawGround(context, arena, colours, beneath) {
  context.fillStyle = colours.paper;
  context.fillRect(arena.x_min, arena.y_min, arena.x_max - arena.x_min, arena.y_max - arena.y_min);
  beneath?.(context);
  if (arena.map) drawMap(context, arena.map, colours);
  drawArena(context, arena, colours);
}

/**
 * Draw a game.
 *
 * @param canvas sized here to its place in the page and the screen's pixels
 * @param scene {game, states, at, colours}: the rules, the states of the game, the number of the one to draw it at, whole or
 *   not, {paper, ink, obstacle, pursuer, evader}; and if wanted: `beneath` and `above`, functions that draw on the bare
 *   ground, and between trails and robots. Team mates have their numbers, and a robot that is out of play is a cross.
 *   In `fog` (`fogOf`) the rival is seen where it is in sight. Signs are `zoom` times as large, as in a small picture
 */
export function draw(canvas, { game, states, at, colours, beneath, above, fog = null, zoom = 1 }) {
  const now = stateAt(states, at);
  const passed = [...states.slice(0, Math.floor(at) + 1), now];
  const context = begin(canvas, game.arena);
  drawGround(context, game.arena, colours, beneath);
  const robots = robotsOf(now, ROLES).filter(({ role }) => !(fog?.isHidden && role === fog.rival));
  for (const who of robots.filter(({ role }) => role !== fog?.rival)) {
    const trail = passed.map((state) => robotOf(state, who)).map(({ x, y }) => [x, y]);
    drawTrail(context, trail, Math.round(GLOWS / game.dt), zoom * leastRadius(game.arena), colours[who.role]);
  }
  drawMovers(context, game, now, colours);
  above?.(context);
  for (const who of robots) drawRobot(context, game, who, now, colours, zoom);
}

/** The movers of a state: discs, and lines with round ends. */
function drawMovers(context, game, { movers }, colours) {
  context.strokeStyle = context.fillStyle = colours.mover;
  for (const { hx, hy, radius, place } of movers ? moversOf(game) : []) {
    const [x, y] = [movers.motion_x[place], movers.motion_y[place]];
    context.lineWidth = 2 * radius;
    if (hx || hy) path(context, [[x - hx, y - hy], [x + hx, y + hy]]).stroke();
    else circle(context, x, y, radius).fill();
  }
}

/** Where a robot was: all of it faintly, what it drove just now as a trail of light; a ring around its start once it has left it. */
function drawTrail(context, trail, recent, radius, colour) {
  const [start, now] = [trail[0], trail.at(-1)];
  context.save();
  context.strokeStyle = colour;
  context.globalAlpha = 0.45;
  context.lineWidth = 0.18 * radius;
  path(context, trail).stroke();
  if (Math.hypot(now[0] - start[0], now[1] - start[1]) > 3 * radius) circle(context, ...start, 0.5 * radius).stroke();
  const lit = trail.slice(-recent - 1);
  context.lineCap = "butt";
  for (let piece = 0; piece < PIECES; piece++) {
    const [from, to] = [piece, piece + 1].map((end) => Math.floor((end * (lit.length - 1)) / PIECES));
    if (to === from) continue;
    const share = (piece + 1) / PIECES;
    for (const [wide, opacity] of LATEST) {
      context.globalAlpha = opacity * share ** 2;
      context.lineWidth = 0.3 * radius * wide * (0.4 + 0.6 * share);
      path(context, lit.slice(from, to + 1)).stroke();
    }
  }
  context.restore();
}

/** The least radius that robots are drawn with in an arena [m]. */
export const leastRadius = ({ x_min, x_max, y_min, y_max }) => SMALLEST * Math.max(x_max - x_min, y_max - y_min);

/** All movers and robots of a state, without their trails. */
export function drawRobots(context, game, state, colours, zoom) {
  drawMovers(context, game, state, colours);
  for (const who of robotsOf(state, ROLES)) drawRobot(context, game, who, state, colours, zoom);
}

/** One of a game's robots. */
function drawRobot(context, game, who, now, colours, zoom) {
  const { role, number } = who;
  const robot = robotOf(now, who);
  const radius = Math.max(bodyOf(game, who).radius, zoom * leastRadius(game.arena));
  if (!isActive(robot)) {
    context.strokeStyle = colours[role];
    context.lineWidth = 0.4 * radius;
    cross(context, robot, radius);
  } else if (role === PURSUER) drawPursuer(context, robot, radius, game.capture_distance, colours);
  else drawEvader(context, robot, radius, colours);
  if (now[role].length > 1) write(context, game.arena, robot, 2.4 * radius, `${number + 1}`, 2.2 * radius, colours[role]);
}

/** Return the point at a distance ahead of a robot, or at an angle to it. */
export function ahead(robot, length, angle = 0) {
  return [robot.x + length * Math.cos(robot.heading + angle), robot.y + length * Math.sin(robot.heading + angle)];
}

/** An arrowhead, and around it a ring as wide as its reach: an evader whose centre comes inside is caught. */
function drawPursuer(context, robot, radius, reach, colours) {
  context.strokeStyle = context.fillStyle = colours.pursuer;
  context.lineWidth = 0.13 * radius;
  circle(context, robot.x, robot.y, reach).stroke();
  const corners = [[1.3, 0], [1.15, 2.4], [0.4, Math.PI], [1.15, -2.4]];
  path(context, corners.map(([length, angle]) => ahead(robot, length * radius, angle))).fill();
}

/** Write beside a robot, at a distance to the side of the arena's middle; `size` is the letters' height [m]. */
export function write(context, arena, robot, distance, text, size, colour) {
  const [right, up] = ["x", "y"].map((axis) => Math.sign(arena[`${axis}_min`] + arena[`${axis}_max`] - 2 * robot[axis]) || 1);
  context.save();
  context.translate(robot.x, robot.y);
  context.scale(1, -1); // letters stand upright
  context.font = `600 ${size}px system-ui, sans-serif`;
  context.textAlign = text.length > 1 ? (right > 0 ? "left" : "right") : "center";
  context.textBaseline = "middle";
  context.fillStyle = colour;
  context.fillText(text, distance * right, -distance * up);
  context.restore();
}

/** A disc with a nose. */
function drawEvader(context, robot, radius, colours) {
  context.strokeStyle = context.fillStyle = colours.evader;
  circle(context, robot.x, robot.y, 0.95 * radius).fill();
  context.lineWidth = 0.3 * radius;
  path(context, [[robot.x, robot.y], ahead(robot, 1.5 * radius)]).stroke();
}
