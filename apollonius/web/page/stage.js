// What is shown of a match in every frame: the arena, the clock, the slow replay, the pads' pressed cells.

import { clearanceAlong } from "./calls.js";
import { ahead, circle, coloursOf, cross, draw, leastRadius, path, stateAt, write } from "./draw.js";
import { drawEffect, endOf, shakeAt } from "./effects.js";
import { fogOf, veilOf } from "./fog.js";
import { bodyOf, isActive, robotOf } from "./game.js";
import { known, layersOf } from "./why.js";

export class Stage {
  /** @param element finds a part of the page by its id; `steering` knows which cells of pads are pressed */
  constructor(element, steering) {
    Object.assign(this, { element, steering, layers: [], known: {} });
    const look = () => (this.colours = coloursOf(document.documentElement));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", look);
    look();
  }

  /** Draw a session as it is at a time [s]. Robots are drawn one step late, between the last two states, to move smoothly. */
  show(session, clock) {
    const { element, colours } = this;
    const { phase, ending, people, choice } = session;
    const attract = session.attract?.isShown ? session.attract : null;
    const match = attract?.match ?? ending?.held ?? session.match;
    const { time } = attract ?? session;
    const last = match.states.length - 1;
    const at = ending?.at(clock) ?? Math.min(last, Math.max(0, last - 1 + time / match.game.dt));
    const now = stateAt(match.states, at);
    const isSilentlyOver = attract?.match.isOver;
    const age = isSilentlyOver ? time : (ending?.sinceEnd(clock) ?? null);
    const end = isSilentlyOver ? endOf(match) : session.end;
    const own = (attract ? [] : people).map((role) => ({ role, number: 0 })).filter((who) => !match.isOver && isActive(robotOf(match.state, who)));
    const fog = attract ? null : fogOf(match, session.me);
    const hasLayers = this.layers.length && !(ending && at < last);
    const shown = fog ? veilOf(match.game.arena, fog, colours) : hasLayers ? layersOf(match, this.#knownOf(match), colours) : {};
    const above = (context) => {
      shown.above?.(context);
      for (const who of own) drawSteered(context, match, who, robotOf(now, who), session.guard, colours);
      if (age !== null) drawEffect(context, match.game, end, ending && match.winner === session.me ? session.me : null, age, colours);
    };
    this.#shake(ending ? (age ?? Infinity) : Infinity);
    draw(element("canvas"), { ...match, at, colours, beneath: shown.beneath, above, fog });
    if (ending) this.#showEnding(session, at);
    const timed = attract ? session.match : match;
    element("clock").textContent = (choice.level?.isEndless ? timed.seconds : Math.max(0, timed.secondsLeft)).toFixed(1);
    if (phase === "playing") for (const role of people) this.#press(role, people.length === 2);
  }

  /** What the layers show of a match now, worked out once for each of its states. */
  #knownOf({ game, state, states, players }) {
    if (this.known.state !== state || this.known.layers !== this.layers) {
      const values = (who) => robotOf(players, who).values?.(game, state, who, states) ?? null;
      this.known = { state, layers: this.layers, found: known(game, states, this.layers, values) };
    }
    return this.known.found;
  }

  #shake(age) {
    const [right, down] = shakeAt(age);
    this.element("canvas").style.transform = right || down ? `translate(${right.toFixed(1)}px, ${down.toFixed(1)}px)` : "";
  }

  /** Show the moment of the slow replay. */
  #showEnding({ ending, lostAt }, at) {
    const { element } = this;
    const when = `${(at * ending.match.game.dt).toFixed(1)}\u00a0s`;
    Object.assign(element("moment"), { max: ending.last, value: Math.round(at), ariaValueText: when });
    element("when").textContent = when;
    element("mark").hidden = lostAt === null;
    element("mark").style.setProperty("--at", lostAt / ending.last);
  }

  #press(role, together) {
    const cell = 8 - this.steering.action(role, together); // the last action is the first cell
    [...this.element(`pad-${role}`).children].forEach((span, index) => span.classList.toggle("on", index === cell));
  }
}

const REACTION = 0.7; // of a person [s]

/**
 * Draw light around a person's robot, and a line to where it would stop: bold when it is time to brake, with a cross when it is
 * too late to brake straight. Where a shield helps it is seen, and who has one is told when to brake.
 */
function drawSteered(context, { game, states }, who, robot, guard, colours) {
  const [body, least] = [bodyOf(game, who), leastRadius(game.arena)];
  const stop = robot.v ** 2 / (2 * Math.max(body.u1_max, 1e-6));
  const touches = (length) => {
    const [x, y] = ahead(robot, length);
    return robot.v > 0 && clearanceAlong(game.arena, robot, { x, y }) < body.radius;
  };
  const [isLate, isTime] = [touches(stop), touches(stop + REACTION * robot.v)];
  const [x, y] = ahead(robot, stop);
  const { isHelping, left } = guard.statusOf(states);
  context.save();
  context.strokeStyle = isLate ? colours.ink : colours[who.role];
  context.lineWidth = (isTime ? 0.4 : 0.2) * least;
  context.setLineDash(isTime ? [] : [0.08, 0.1]);
  path(context, [[robot.x, robot.y], [x, y]]).stroke();
  context.setLineDash([]);
  if (isLate) cross(context, { x, y }, least);
  context.fillStyle = context.strokeStyle = colours[who.role];
  context.globalAlpha = 0.16;
  circle(context, robot.x, robot.y, 2.6 * least).fill();
  context.globalAlpha = states.length % 2 ? 1 : 0.3;
  context.lineWidth = 0.35 * least;
  if (isHelping) circle(context, robot.x, robot.y, 2.6 * least).stroke();
  context.restore();
  const said = isHelping ? `shield${Number.isFinite(left) ? `: ${left} left` : ""}` : isTime && guard.times ? "brake: ↓" : "";
  if (said) write(context, game.arena, robot, 4 * least, said, 2 * least, colours.ink);
}
