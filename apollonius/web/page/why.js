// Why agents do what they do: layers of what can be known of a state of a game, and how they are drawn beneath and above its
// robots. Lengths are in metres.

import { CELLS, canStop, leads, move } from "./calls.js";
import { circle, cross, path } from "./draw.js";
import { drawCells, isFoggy, knowledge } from "./fog.js";
import { ACTIONS, EVADER, PURSUER, ROLES, bodyOf, isActive, robotOf, robotsOf } from "./game.js";

const HELD = 1; // for how long actions are held to show where they lead [s]
const [LEAST, MOST] = [0.015, 0.11]; // radii of dots for the worst action and the best
const CROSS = 0.06; // half of its width
const FAINT = 0.22; // how opaque regions are
const DENSE = 0.35; // how opaque a belief is

/** Labels of the layers. */
export const LAYERS = {
  values: "Values: the larger a dot, the more the agent values that action",
  brakes: "Brakes: crosses mark actions after which the robot could no longer stop in time",
  regions: "Regions: blue where blue arrives first, on the shortest path at full thrust; turns are ignored",
  belief: "Belief, in fog: red does not know where in the shade blue is",
};

// ---- what is known

/** Return where each action leads a robot that holds it for a while. */
function ends(game, body, robot) {
  const held = Math.max(1, Math.round(HELD / game.dt));
  return ACTIONS.map((action) => {
    let end = robot;
    for (let count = 0; count < held; count++) end = move(body, end, action, game.dt);
    return end;
  });
}

/** Which actions leave a robot room to stop: what the shield lets pass. */
export const stoppable = (game, state, who) => ACTIONS.map((action) => canStop(game, state, who, action));

/** Return values from 0, the worst, to 1, the best; null of none. */
function scaled(values) {
  if (!values) return null;
  const [least, most] = [Math.min(...values), Math.max(...values)];
  return Array.from(values, (value) => (value - least) / Math.max(most - least, 1e-9));
}

/**
 * What layers show of the last of some states of a game.
 *
 * @param shown keys of `LAYERS`
 * @param values from a robot in play, {role, number}, to its player's values of the nine actions, or null
 * @returns {robots, leads, belief}: of each robot in play {role, number, ends, values, stops}; who is first at each cell; what
 *   the pursuer knows in fog; what is not shown or not known is null
 */
export function known(game, states, shown, values) {
  const state = states.at(-1);
  const robots = robotsOf(state, ROLES).filter((who) => isActive(robotOf(state, who))).map((who) => ({
    ...who,
    ends: ends(game, bodyOf(game, who), robotOf(state, who)),
    values: shown.includes("values") ? scaled(values(who)) : null,
    stops: shown.includes("brakes") ? stoppable(game, state, who) : null,
  }));
  const belief = shown.includes("belief") && isFoggy(game, PURSUER) ? knowledge(game, states, PURSUER) : null;
  return { robots, leads: shown.includes("regions") ? widened(widened(leads(game, state))) : null, belief };
}

// ---- how it is drawn

/** Return functions that draw what is known of a state: on the bare ground, and above the trails. */
export function layersOf({ game, state }, { leads, robots, belief }, colours) {
  const beneath = (context) => {
    const first = (lead) => (Number.isNaN(lead) ? null : colours[lead > 0 ? EVADER : PURSUER]);
    if (leads) drawCells(context, game.arena, FAINT, leads, colours, first);
    if (belief) drawCells(context, game.arena, DENSE, belief.budget, colours);
  };
  const above = (context) => {
    context.save();
    for (const robot of robots) drawActions(context, robotOf(state, robot), robot, colours);
    context.restore();
  };
  return { beneath, above };
}

/** Return leads where each cell without a path, as beside walls, takes the lead of one next to it. */
function widened(leads) {
  return leads.map((lead, cell) => {
    if (!Number.isNaN(lead)) return lead;
    const column = cell % CELLS;
    const [left, right] = [column > 0 ? cell - 1 : cell, column < CELLS - 1 ? cell + 1 : cell];
    const beside = [left, right, cell - CELLS, cell + CELLS].map((other) => leads[other]);
    return beside.find((other) => other !== undefined && !Number.isNaN(other)) ?? lead;
  });
}

/** Draw where each action leads: a dot by its value, a cross where the robot could then no longer stop. */
function drawActions(context, from, { role, ends, values, stops }, colours) {
  ends.forEach(({ x, y }, action) => {
    const isBest = values?.[action] === 1;
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
    cross(context, { x, y }, CROSS);
  });
}
