// A match under way on a canvas: the arena, trails, robots. Lengths are in metres, y points up.

import { circle, drawArena, drawTrail, path } from "./arena.js";
import { drawMap } from "./cells.js";
import { EVADER, PURSUER, wrapAngle } from "./rules.js";

const ROBOT = 0.16; // least radius that a robot is drawn with [m]
const MARGIN = 0.25; // around the walls [m]
const METRES = { scale: 1, x: (metres) => metres, y: (metres) => metres }; // the canvas has been scaled to them

/** A state between two others, `share` of the way from the first to the second. */
export function between(before, after, share) {
  const mix = (a, b) => a + (b - a) * share;
  const robot = (role) => ({
    x: mix(before[role].x, after[role].x),
    y: mix(before[role].y, after[role].y),
    v: mix(before[role].v, after[role].v),
    heading: before[role].heading + share * wrapAngle(after[role].heading - before[role].heading),
  });
  return { pursuer: robot(PURSUER), evader: robot(EVADER) };
}

/**
 * Draw a game.
 *
 * @param canvas sized here to its place in the page and the screen's pixels
 * @param game the rules
 * @param states of the game so far; their trails are drawn
 * @param now the state to draw the robots at
 * @param colours {paper, ink, obstacle, pursuer, evader}
 * @param steered roles whose way to rest is drawn, where they would stop if they braked
 */
export function draw(canvas, game, states, now, colours, steered = []) {
  const { arena } = game;
  const [width, height] = [arena.x_max - arena.x_min, arena.y_max - arena.y_min];
  const scale = (canvas.clientWidth * globalThis.devicePixelRatio) / (width + 2 * MARGIN);
  const pixels = [width, height].map((length) => Math.round((length + 2 * MARGIN) * scale));
  if (canvas.width !== pixels[0] || canvas.height !== pixels[1]) [canvas.width, canvas.height] = pixels;
  const context = canvas.getContext("2d");
  context.resetTransform();
  context.clearRect(0, 0, ...pixels);
  context.setTransform(scale, 0, 0, -scale, (MARGIN - arena.x_min) * scale, (MARGIN + arena.y_max) * scale);
  context.lineJoin = context.lineCap = "round";

  context.fillStyle = colours.paper;
  context.fillRect(arena.x_min, arena.y_min, width, height);
  if (arena.map) drawMap(context, arena.map, colours.obstacle);
  drawArena(context, arena, METRES, colours, 0.05);
  for (const role of [PURSUER, EVADER]) {
    const trail = states.map((state) => [state[role].x, state[role].y]);
    drawTrail(context, trail, colours[role], 0.035, 0.08);
  }
  for (const role of steered) drawWayToRest(context, game[role], now[role], colours[role]);
  drawPursuer(context, now.pursuer, Math.max(game.pursuer.radius, ROBOT), game.capture_distance, colours);
  drawEvader(context, now.evader, Math.max(game.evader.radius, ROBOT), colours);
}

/** What lies so far ahead of a robot, or at an angle to it. */
function ahead(robot, length, angle = 0) {
  return [robot.x + length * Math.cos(robot.heading + angle), robot.y + length * Math.sin(robot.heading + angle)];
}

function drawWayToRest(context, body, robot, colour) {
  const reach = robot.v ** 2 / (2 * body.u1_max);
  context.strokeStyle = colour;
  context.lineWidth = 0.03;
  context.setLineDash([0.08, 0.1]);
  path(context, [[robot.x, robot.y], ahead(robot, reach)]).stroke();
  context.setLineDash([]);
}

/** An arrowhead, and around it a ring as wide as its reach: an evader whose centre comes inside is caught. */
function drawPursuer(context, robot, radius, reach, colours) {
  context.strokeStyle = context.fillStyle = colours.pursuer;
  context.lineWidth = 0.02;
  circle(context, robot.x, robot.y, reach).stroke();
  const corners = [[1.4, 0], [1.2, 2.4], [0.4, Math.PI], [1.2, -2.4]];
  path(context, corners.map(([length, angle]) => ahead(robot, length * radius, angle))).fill();
}

/** A disc with a nose. */
function drawEvader(context, robot, radius, colours) {
  context.strokeStyle = context.fillStyle = colours.evader;
  circle(context, robot.x, robot.y, 0.8 * radius).fill();
  context.lineWidth = 0.06;
  path(context, [[robot.x, robot.y], ahead(robot, 1.7 * radius)]).stroke();
}
