// Players that follow a rule instead of a network, function by function `chasing.py`, `fleeing.py` and `guarding.py` of
// `apollonius/agents/`, and `surrounding.js`. Each values the nine actions for one robot of a game.

import { clearanceAlong, clip } from "./clearance.js";
import { arcSpeed, direction, separation } from "./driving.js";
import { EVADER, PURSUER, move, wrapAngle } from "./rules.js";
import { encirclement, voronoiPursuit } from "./surrounding.js";
import { countsOf } from "./teams.js";
import { look } from "./view.js";

const ACTIONS = [0, 1, 2, 3, 4, 5, 6, 7, 8];
const AWARE = { horizon: 4, margin: 0.1, caution: 1 }; // looked ahead [s], room to keep [m], what a metre of it is worth
const EQUAL = 1e-3; // squares of speeds that differ by less than this share are equal

// ---- courses: a heading [rad] and a speed [m/s] to have, from what one robot sees

function purePursuit({ body, own, opponent }) {
  return [direction(own, opponent), arcSpeed(body, own, opponent)];
}

function intercept({ body, own, opponent }) {
  const sight = direction(own, opponent);
  const across = opponent.v * Math.sin(opponent.heading - sight);
  return [sight + Math.asin(clip(across / body.v_max, -1, 1)), arcSpeed(body, own, opponent)];
}

const flee = ({ body, own, opponent }) => [direction(opponent, own), body.v_max];

function territory({ game, role, body, own, opponent, opponentBody }) {
  const goal = game.arena.territory;
  const ends = [[own, body.v_max], [opponent, opponentBody.v_max]];
  const [[pursuer, fast], [evader, slow]] = role === PURSUER ? ends : ends.toReversed();
  const target = nearestReach(evader, pursuer, slow / fast, goal);
  return [direction(own, target), arcSpeed(body, own, target)];
}

/** Of the places that the evader, `ratio` times as fast, can be at before the pursuer, the one nearest to a goal. */
export function nearestReach(evader, pursuer, ratio, goal) {
  const square = ratio ** 2;
  const squared = (x, y) => x * x + y * y;
  if (squared(goal.x - evader.x, goal.y - evader.y) < square * squared(goal.x - pursuer.x, goal.y - pursuer.y)) return goal;
  const [sightX, sightY] = [pursuer.x - evader.x, pursuer.y - evader.y];
  const sightSquared = Math.max(squared(sightX, sightY), 1e-9);
  if (Math.abs(1 - square) < EQUAL) {
    const [fromX, fromY] = [goal.x - (evader.x + pursuer.x) / 2, goal.y - (evader.y + pursuer.y) / 2];
    const beyond = (fromX * sightX + fromY * sightY) / sightSquared;
    return { x: goal.x - beyond * sightX, y: goal.y - beyond * sightY };
  }
  const rest = 1 - square;
  const centre = { x: (evader.x - square * pursuer.x) / rest, y: (evader.y - square * pursuer.y) / rest };
  const radius = Math.sqrt(square * sightSquared) / Math.abs(rest);
  const [outX, outY] = [goal.x - centre.x, goal.y - centre.y];
  const scale = radius / Math.max(Math.hypot(outX, outY), 1e-6);
  return { x: centre.x + scale * outX, y: centre.y + scale * outY };
}

// ---- values

/** Minus how far heading and speed are from the course after each action, in steps of full turn and thrust. */
const steering = (course) => (seen) => {
  const { game, body, own } = seen;
  const [heading, speed] = course(seen);
  const turn = Math.max(body.u2_max * game.dt, 1e-6);
  const thrust = Math.max(body.u1_max * game.dt, 1e-6);
  return ACTIONS.map((action) => {
    const after = move(body, own, action, game.dt);
    return -Math.abs(wrapAngle(heading - after.heading)) / turn - Math.abs(speed - after.v) / thrust;
  });
};

/** Where each action, held, leads: furthest from a pursuer that goes straight on, and not out of room. */
function fleeAware({ game, body, own, opponent, opponentBody }) {
  const steps = Math.ceil(AWARE.horizon / game.dt);
  const pursuer = move(opponentBody, opponent, 4, steps * game.dt);
  return ACTIONS.map((action) => {
    let [robot, room, runsOut] = [own, Infinity, steps];
    for (let step = 0; step < steps; step++) {
      const after = move(body, robot, action, game.dt);
      const here = clearanceAlong(game.arena, robot, after) - body.radius;
      if (here <= AWARE.margin) runsOut = Math.min(runsOut, step);
      [robot, room] = [after, Math.min(room, here)];
    }
    return runsOut < steps ? runsOut - steps : separation(robot, pursuer) + AWARE.caution * Math.min(room, 1);
  });
}

const CHASERS = {
  "pure-pursuit": steering(purePursuit),
  intercept: steering(intercept),
  "voronoi-pursuit": steering(voronoiPursuit),
  encirclement: steering(encirclement),
};
const FOR_TEAMS = ["voronoi-pursuit", "encirclement"];
const RUNNERS = {
  flee: steering(flee),
  "flee-aware": fleeAware,
};

/** The players of one side by name: from (game, state, who) to the values of the nine actions. */
export const CLASSICAL = Object.fromEntries(
  [[PURSUER, CHASERS], [EVADER, RUNNERS]].map(([side, rules]) => {
    const all = Object.entries({ ...rules, territory: steering(territory) });
    return [side, Object.fromEntries(all.map(([name, rule]) => [name, (...seen) => rule(plainly(look(...seen)))]))];
  }),
);

/** Whether a rule can be followed in a game of so many robots. */
export function fits(name, game, [pursuers] = countsOf(game)) {
  const { arena } = game;
  if (FOR_TEAMS.includes(name)) return pursuers > 1;
  return name !== "territory" || Boolean(arena.territory);
}

/** A view in which the states of the two robots that matter most stand apart from their limits. */
function plainly({ own, opponent, ...view }) {
  return { ...view, body: own.body, own: own.state, opponent: opponent.state, opponentBody: opponent.body };
}
