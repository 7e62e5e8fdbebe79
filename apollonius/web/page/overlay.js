// The layers of a match on the canvas, beneath its robots: what `layers.js` and `insight.js` have worked out. Lengths are in metres.

import { circle, path } from "./arena.js";
import { STOPS } from "./calls.js";
import { EVADER, PURSUER, robotOf } from "./game.js";

const [LEAST, MOST] = [0.015, 0.11]; // radii of dots for the worst action and the best
const CROSS = 0.06; // half of its width
const FAINT = 0.22; // how opaque regions are

/** Return functions that draw {leads, robots, course}: on the bare ground, and above the trails. */
export function layersOf({ game, state }, { leads, robots, course }, colours) {
  const beneath = (context) => leads && drawRegions(context, game.arena, leads, colours);
  const above = (context) => {
    context.save();
    if (course?.length > 1) for (const who of robots) drawCourse(context, course, who, colours);
    for (const robot of robots) drawActions(context, robotOf(state, robot), robot, colours);
    context.restore();
  };
  return { beneath, above };
}

let picture, painted; // a cell for each stop, and the leads that it shows

function drawRegions(context, arena, leads, colours) {
  if (painted !== leads) paint(leads, colours);
  const { x_min: x, x_max: right, y_min: y, y_max: top } = arena;
  const side = Math.max(right - x, top - y);
  context.save();
  context.globalAlpha = FAINT;
  context.beginPath();
  context.rect(x, y, right - x, top - y);
  context.clip();
  context.drawImage(picture, x, y, side, side);
  context.restore();
}

/** Return leads where each stop without a path, as beside walls, takes the lead of one next to it. */
function widened(leads) {
  return leads.map((lead, stop) => {
    if (!Number.isNaN(lead)) return lead;
    const column = stop % STOPS;
    const [left, right] = [column > 0 ? stop - 1 : stop, column < STOPS - 1 ? stop + 1 : stop];
    const beside = [left, right, stop - STOPS, stop + STOPS].map((other) => leads[other]);
    return beside.find((other) => other !== undefined && !Number.isNaN(other)) ?? lead;
  });
}

/** Each cell in the colour of who is first there. */
function paint(found, colours) {
  painted = found;
  picture ??= new OffscreenCanvas(STOPS, STOPS);
  const leads = widened(widened(found));
  const context = picture.getContext("2d");
  context.clearRect(0, 0, STOPS, STOPS);
  for (const [colour, isTheirs] of [[colours[PURSUER], (lead) => lead <= 0], [colours[EVADER], (lead) => lead > 0]]) {
    context.fillStyle = colour;
    context.beginPath();
    leads.forEach((lead, stop) => isTheirs(lead) && context.rect(stop % STOPS, Math.floor(stop / STOPS), 1, 1));
    context.fill();
  }
}

function drawCourse(context, course, who, colours) {
  context.strokeStyle = colours[who.role];
  context.lineWidth = 0.05;
  context.setLineDash([0.02, 0.12]);
  path(context, course.map((state) => robotOf(state, who)).map(({ x, y }) => [x, y])).stroke();
  context.setLineDash([]);
  const { x, y } = robotOf(course.at(-1), who);
  circle(context, x, y, 0.09).stroke();
}

/** Draw where each action leads: a dot by its value, a cross where the robot could then no longer stop. */
function drawActions(context, from, { role, ends, values, stops }, colours) {
  const best = values ? Math.max(...values) : null;
  ends.forEach(({ x, y }, action) => {
    const isBest = values && values[action] === best;
    context.globalAlpha = isBest ? 1 : 0.55;
    if (values) {
      context.fillStyle = context.strokeStyle = colours[role];
      context.lineWidth = 0.02;
      if (isBest) path(context, [[from.x, from.y], [x, y]]).stroke();
      circle(context, x, y, LEAST + (MOST - LEAST) * values[action]).fill();
    }
    if (!stops || stops[action]) return;
    context.strokeStyle = colours.ink;
    context.lineWidth = 0.03;
    for (const tilt of [CROSS, -CROSS]) path(context, [[x - CROSS, y - tilt], [x + CROSS, y + tilt]]).stroke();
  });
}
