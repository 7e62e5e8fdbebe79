// What networks read, by the names that agents' files have for it: as in `apollonius/observe/`.

import { clearance, clip } from "./clearance.js";
import { egocentric } from "./egocentric.js";
import { team } from "./team.js";
import { look } from "./view.js";

const scale = (value, low, high) => (2 * value - (low + high)) / Math.max(high - low, 1e-6);

function positionAndSpeed(arena, { body, state }) {
  return [
    scale(state.x, arena.x_min, arena.x_max),
    scale(state.y, arena.y_min, arena.y_max),
    scale(state.v, body.v_min, body.v_max),
  ];
}

function clearances(arena, { body, state }) {
  const braking = Math.max(state.v, 0) ** 2 / Math.max(2 * body.u1_max, 1e-6);
  const here = clearance(arena, state.x, state.y);
  const x = state.x + braking * Math.cos(state.heading);
  const y = state.y + braking * Math.sin(state.heading);
  return [clip(here - body.radius, -1, 1), clip(clearance(arena, x, y) - body.radius, -1, 1)];
}

/** Eight numbers (Eq. 7). */
function paper({ game: { arena }, own, opponent }) {
  return [own, opponent].flatMap((robot) => [...positionAndSpeed(arena, robot), robot.state.heading / Math.PI]);
}

/** Seventeen numbers. */
function encoded({ game: { arena }, own: looking, opponent: nearest }) {
  const robots = [looking, nearest];
  const [own, opponent] = robots.map(({ state }) => state);
  const size = Math.max(arena.x_max - arena.x_min, arena.y_max - arena.y_min);
  const dx = (opponent.x - own.x) / size;
  const dy = (opponent.y - own.y) / size;
  const cos = Math.cos(own.heading);
  const sin = Math.sin(own.heading);
  return [
    ...robots.flatMap((robot) => [
      ...positionAndSpeed(arena, robot),
      Math.cos(robot.state.heading),
      Math.sin(robot.state.heading),
    ]),
    ...[cos * dx + sin * dy, cos * dy - sin * dx, Math.hypot(dx, dy)],
    ...robots.flatMap((robot) => clearances(arena, robot)),
  ];
}

/** From what a robot sees to numbers. */
const OBSERVATIONS = { paper, encoded, egocentric, team };

/** What one robot sees, {role, number}, by the observation of this name. */
export const observe = (name, game, state, who) => OBSERVATIONS[name](look(game, state, who));
