// What a game's end looks like: a capture is a shock wave, a crash splinters, a win of the person's is a rain of light. Lengths
// are in metres, times in seconds since the end. Who wants little motion sees a ring that stands still.

import { circle, path } from "./draw.js";
import { PURSUER, ROLES, isActive, robotOf, robotsOf } from "./game.js";
import { makeRandom } from "./starts.js";

export const LASTS = 1.4; // an effect [s]
const [SHAKES, SHAKE] = [0.45, 7]; // for how long [s], and how far at first [px]
const [WAVES, SHARDS, SPARKS] = [3, 18, 90];
const FLASH = 0.12; // [s]

export const isCalm = () => matchMedia("(prefers-reduced-motion: reduce)").matches;

/** Where and how a game that is over ended: {x, y, role, isCapture} of the robot that went out of play last, or null. */
export function endOf({ state, outcome }) {
  const gone = robotsOf(state, ROLES).filter((who) => !isActive(robotOf(state, who)));
  const who = gone.find(({ role }) => outcome.startsWith(role)) ?? gone.at(-1);
  return who ? { ...robotOf(state, who), role: who.role, isCapture: robotOf(state, who).status === "captured" } : null;
}

/** Draw the effect of an end at its age; `winner` is the side of a person who has won, or null. */
export function drawEffect(context, { arena }, end, winner, age, colours) {
  const calm = isCalm();
  const share = calm ? 0.5 : age / LASTS;
  if (age > LASTS && !calm) return;
  context.save();
  if (end?.isCapture) drawWaves(context, end, share, colours[PURSUER], calm);
  else if (end) drawShards(context, end, share, colours, calm);
  if (winner && !calm) drawRain(context, arena, share, colours[winner]);
  if (!calm && age < FLASH && end) {
    context.globalAlpha = 0.35 * (1 - age / FLASH);
    context.fillStyle = end.isCapture ? colours[PURSUER] : colours.ink;
    context.fillRect(arena.x_min, arena.y_min, arena.x_max - arena.x_min, arena.y_max - arena.y_min);
  }
  context.restore();
}

/** How far the picture is shaken [px] at an age: [right, down]. */
export function shakeAt(age) {
  if (age > SHAKES || isCalm()) return [0, 0];
  const far = SHAKE * (1 - age / SHAKES) ** 2;
  return [far * Math.sin(70 * age), far * Math.cos(53 * age)];
}

function drawWaves(context, { x, y }, share, colour, calm) {
  context.strokeStyle = colour;
  for (let wave = 0; wave < (calm ? 1 : WAVES); wave++) {
    const own = share - 0.14 * wave;
    if (own <= 0 || own >= 1) continue;
    context.globalAlpha = (1 - own) ** 1.5;
    context.lineWidth = 0.16 * (1 - own) + 0.02;
    circle(context, x, y, 0.3 + 2.2 * Math.sqrt(own)).stroke();
  }
}

function drawShards(context, { x, y, heading, role }, share, colours, calm) {
  const random = makeRandom(Math.round(1e3 * (x + y)));
  context.strokeStyle = colours[role];
  context.globalAlpha = (1 - share) ** 1.2;
  for (let shard = 0; shard < SHARDS; shard++) {
    // Away from what was hit: most of them backwards.
    const angle = heading + Math.PI + 2.4 * (random() - 0.5) + (random() < 0.2 ? Math.PI : 0);
    const far = (0.2 + 1.3 * random()) * Math.sqrt(share);
    const long = 0.05 + 0.12 * random();
    context.lineWidth = 0.03 + 0.04 * random();
    const at = (length) => [x + length * Math.cos(angle), y + length * Math.sin(angle)];
    if (!calm) path(context, [at(far), at(far + long)]).stroke();
  }
  context.strokeStyle = colours.ink;
  context.lineWidth = 0.08 * (1 - share) + 0.01;
  circle(context, x, y, 0.2 + 0.9 * Math.sqrt(share)).stroke();
}

function drawRain(context, { x_min, x_max, y_min, y_max }, share, colour) {
  const random = makeRandom(7);
  const [width, height] = [x_max - x_min, y_max - y_min];
  context.fillStyle = colour;
  for (let spark = 0; spark < SPARKS; spark++) {
    const [across, high, size, drift] = [random(), random(), random(), random() - 0.5];
    context.globalAlpha = 0.85 * (1 - share) * (0.4 + 0.6 * size);
    const rise = high + 0.5 * share * (0.5 + size);
    circle(context, x_min + width * (across + 0.05 * drift * share), y_min + height * (rise % 1), (0.02 + 0.07 * size) * (height / 10)).fill();
  }
}
