// A match under way on a canvas: the arena, trails, robots. Lengths are in metres, y points up.

import { circle, drawArena, drawMap, drawTrail, path } from "./arena.js";
import { PURSUER, ROLES, bodyOf, isActive, robotOf, robotsOf, wrapAngle } from "./game.js";
import { isTooFast, restOf } from "./hints.js";

const ROBOT = 0.16; // least radius that a robot is drawn with [m]
const SMALLEST = 0.018; // least radius, as a share of the arena, so that robots are found in large arenas
const MARGIN = 0.25; // around the walls [m]

/** A state between two others, `share` of the way from the first to the second. */
export function between(before, after, share) {
  const mix = (a, b) => a + (b - a) * share;
  const robot = (start, end) => ({
    x: mix(start.x, end.x),
    y: mix(start.y, end.y),
    v: mix(start.v, end.v),
    heading: start.heading + share * wrapAngle(end.heading - start.heading),
    status: share < 1 ? start.status : end.status,
  });
  const side = (role) => before[role].map((start, number) => robot(start, after[role][number]));
  return { ...after, ...Object.fromEntries(ROLES.map((role) => [role, side(role)])) };
}

/** Return the `scale` of a canvas that shows an arena, in pixels per metre, and the pixel of the origin. */
export function placing(canvas, arena) {
  const [width, height] = [arena.x_max - arena.x_min + 2 * MARGIN, arena.y_max - arena.y_min + 2 * MARGIN];
  const scale = Math.min(canvas.width / width, canvas.height / height);
  const x = canvas.width / 2 - (scale * (arena.x_min + arena.x_max)) / 2;
  const y = canvas.height / 2 + (scale * (arena.y_min + arena.y_max)) / 2;
  return { scale, x, y };
}

/** Clear a canvas, as large as its place in the page, and scale it to metres; returns its context. */
export function begin(canvas, arena) {
  const ratio = globalThis.devicePixelRatio;
  const pixels = [canvas.clientWidth, canvas.clientHeight].map((length) => Math.max(1, Math.round(length * ratio)));
  if (canvas.width !== pixels[0] || canvas.height !== pixels[1]) [canvas.width, canvas.height] = pixels;
  const context = canvas.getContext("2d");
  const { scale, x, y } = placing(canvas, arena);
  context.resetTransform();
  context.clearRect(0, 0, ...pixels);
  context.setTransform(scale, 0, 0, -scale, x, y);
  context.lineJoin = context.lineCap = "round";
  return context;
}

/** The ground of an arena and what stands on it; `beneath` draws on the bare ground. */
export function drawGround(context, arena, colours, beneath = null) {
  context.fillStyle = colours.paper;
  context.fillRect(arena.x_min, arena.y_min, arena.x_max - arena.x_min, arena.y_max - arena.y_min);
  beneath?.(context);
  if (arena.map) drawMap(context, arena.map, colours.obstacle);
  drawArena(context, arena, colours);
}

/**
 * Draw a game.
 *
 * @param canvas sized here to its place in the page and the screen's pixels
 * @param scene {game, states, now, colours}: the rules, the states of the game so far with their trails, the state to
 *   draw the robots at, {paper, ink, obstacle, pursuer, evader}; and if wanted: `steered`, robots {role, number} whose way
 *   to rest is drawn, `halo`, from 0 to 1, how far a ring around them has widened, `advice`, keys to show beside them,
 *   `layers`, {beneath, above}: what draws on the bare ground, and between trails and robots. Team mates have their numbers, and a robot that is out of play is a cross
 */
export function draw(canvas, { game, states, now, colours, steered = [], halo = null, advice = null, layers = null }) {
  const { arena } = game;
  const context = begin(canvas, arena);
  drawGround(context, arena, colours, layers?.beneath);
  const robots = robotsOf(now, ROLES);
  for (const who of robots) {
    const trail = states.map((state) => robotOf(state, who)).map(({ x, y }) => [x, y]);
    drawTrail(context, trail, colours[who.role]);
  }
  layers?.above(context);
  const least = Math.max(ROBOT, SMALLEST * Math.max(arena.x_max - arena.x_min, arena.y_max - arena.y_min));
  for (const who of steered) {
    const robot = robotOf(now, who);
    drawWayToRest(context, game, who, robot, colours);
    if (halo !== null) drawHalo(context, robot, least, halo, colours[who.role]);
    if (advice) drawAdvice(context, robot, least, advice, colours);
  }
  for (const who of robots) drawRobot(context, game, who, now, least, colours);
}

/** One of a game's robots; `least` is the radius that it is drawn with at least. */
function drawRobot(context, game, who, now, least, colours) {
  const { role, number } = who;
  const robot = robotOf(now, who);
  const radius = Math.max(bodyOf(game, who).radius, least);
  if (!isActive(robot)) drawCross(context, robot, radius, colours[role]);
  else if (role === PURSUER) drawPursuer(context, robot, radius, game.capture_distance, colours);
  else drawEvader(context, robot, radius, colours);
  if (now[role].length > 1) drawNumber(context, robot, radius, number + 1, colours[role]);
}

/** Return the point at a distance ahead of a robot, or at an angle to it. */
function ahead(robot, length, angle = 0) {
  return [robot.x + length * Math.cos(robot.heading + angle), robot.y + length * Math.sin(robot.heading + angle)];
}

/** Dots to where a robot would stop if it braked; where it would touch something first, a bold line and a cross. */
function drawWayToRest(context, game, who, robot, colours) {
  const rest = restOf(bodyOf(game, who), robot);
  const isLate = robot.v > 0 && isTooFast(game, who, robot);
  context.strokeStyle = isLate ? colours.ink : colours[who.role];
  context.lineWidth = isLate ? 0.06 : 0.03;
  context.setLineDash(isLate ? [] : [0.08, 0.1]);
  path(context, [[robot.x, robot.y], [rest.x, rest.y]]).stroke();
  context.setLineDash([]);
  if (!isLate) return;
  for (const tilt of [0.15, -0.15]) path(context, [[rest.x - 0.15, rest.y - tilt], [rest.x + 0.15, rest.y + tilt]]).stroke();
}

/** A ring that widens and fades: this one is you. */
function drawHalo(context, robot, radius, share, colour) {
  context.save();
  context.globalAlpha = 1 - share;
  context.strokeStyle = colour;
  context.lineWidth = 0.3 * radius;
  circle(context, robot.x, robot.y, radius * (1.5 + 3 * share)).stroke();
  context.restore();
}

/** Letters that stand upright, so large [m], around a robot. */
function beginLetters(context, robot, size) {
  context.save();
  context.translate(robot.x, robot.y);
  context.scale(1, -1);
  context.font = `${size}px system-ui, sans-serif`;
  context.textAlign = "center";
  context.textBaseline = "middle";
}

/** Keys beside a robot, such as "↑". */
function drawAdvice(context, robot, radius, keys, colours) {
  const size = 3.4 * radius;
  beginLetters(context, robot, size);
  context.lineWidth = 0.2 * radius;
  [...keys].forEach((key, index) => {
    const [x, y] = [(index - (keys.length - 1) / 2) * 1.3 * size, -1.3 * size];
    context.fillStyle = colours.ink;
    context.beginPath();
    context.roundRect(x - 0.58 * size, y - 0.58 * size, 1.16 * size, 1.16 * size, 0.25 * size);
    context.fill();
    context.fillStyle = colours.paper;
    context.fillText(key, x, y);
  });
  context.restore();
}

/** An arrowhead, and around it a ring as wide as its reach: an evader whose centre comes inside is caught. */
function drawPursuer(context, robot, radius, reach, colours) {
  context.strokeStyle = context.fillStyle = colours.pursuer;
  context.lineWidth = 0.02;
  circle(context, robot.x, robot.y, reach).stroke();
  const corners = [[1.4, 0], [1.2, 2.4], [0.4, Math.PI], [1.2, -2.4]];
  path(context, corners.map(([length, angle]) => ahead(robot, length * radius, angle))).fill();
}

/** The number of a team mate, beside it. */
function drawNumber(context, robot, radius, number, colour) {
  beginLetters(context, robot, 2.2 * radius);
  context.fillStyle = colour;
  context.fillText(`${number}`, 2.4 * radius, -2.4 * radius);
  context.restore();
}

/** Out of play. */
function drawCross(context, robot, radius, colour) {
  context.strokeStyle = colour;
  context.lineWidth = 0.4 * radius;
  for (const slope of [radius, -radius]) path(context, [[robot.x - radius, robot.y - slope], [robot.x + radius, robot.y + slope]]).stroke();
}

/** A disc with a nose. */
function drawEvader(context, robot, radius, colours) {
  context.strokeStyle = context.fillStyle = colours.evader;
  circle(context, robot.x, robot.y, 0.8 * radius).fill();
  context.lineWidth = 0.06;
  path(context, [[robot.x, robot.y], ahead(robot, 1.7 * radius)]).stroke();
}
