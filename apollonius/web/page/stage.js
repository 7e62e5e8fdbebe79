// What is shown of a match in every frame: the arena, the clock, the slow replay, the pads' pressed cells.

import { clearanceAlong } from "./calls.js";
import { ahead, circle, coloursOf, cross, draw, leastRadius, path, stateAt } from "./draw.js";
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
    const { phase, time, ending, people, choice } = session;
    const match = ending?.held ?? session.match;
    const last = match.states.length - 1;
    const at = ending?.at(clock) ?? Math.max(0, last - 1 + time / match.game.dt);
    const now = stateAt(match.states, at);
    const own = people.map((role) => ({ role, number: 0 })).filter((who) => !match.isOver && isActive(robotOf(match.state, who)));
    const fog = fogOf(match, session.me);
    const hasLayers = this.layers.length && !(ending && at < last);
    const shown = fog ? veilOf(match.game.arena, fog, colours) : hasLayers ? layersOf(match, this.#knownOf(match), colours) : {};
    const above = (context) => {
      shown.above?.(context);
      for (const who of own) drawSteered(context, match.game, who, robotOf(now, who), colours);
    };
    draw(element("canvas"), { ...match, at, colours, beneath: shown.beneath, above, fog });
    if (ending) this.#showEnding(session, at);
    element("clock").textContent = (choice.level?.isEndless ? match.seconds : Math.max(0, match.secondsLeft)).toFixed(1);
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

/** Draw a ring around a person's robot, and a line to where it would stop; bold with a cross if it touches something first. */
function drawSteered(context, game, who, robot, colours) {
  const [body, least] = [bodyOf(game, who), leastRadius(game.arena)];
  const [x, y] = ahead(robot, robot.v ** 2 / (2 * Math.max(body.u1_max, 1e-6)));
  const isLate = robot.v > 0 && clearanceAlong(game.arena, robot, { x, y }) < body.radius;
  context.strokeStyle = isLate ? colours.ink : colours[who.role];
  context.lineWidth = isLate ? 0.06 : 0.03;
  context.setLineDash(isLate ? [] : [0.08, 0.1]);
  path(context, [[robot.x, robot.y], [x, y]]).stroke();
  context.setLineDash([]);
  if (isLate) cross(context, { x, y }, 0.15);
  context.strokeStyle = colours[who.role];
  context.lineWidth = 0.3 * least;
  circle(context, robot.x, robot.y, 2.1 * least).stroke();
}
