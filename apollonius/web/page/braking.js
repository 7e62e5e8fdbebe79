// Whether a robot can still stop in time: what the shield of `apollonius/agents/shield.py` asks before each action.

import { clearance, clearanceAlong } from "./clearance.js";
import { move } from "./rules.js";

const MARGIN = 1e-3; // room [m] that the shield wants
const ESCAPES = [0, 1, 2]; // gears of the wheel, while braking

const brakingSteps = (game, body) => Math.ceil(body.v_max / (body.u1_max * game.dt));

/** The steps in which a robot brakes to rest with its wheel in one gear: pairs of states. */
function* braking(game, body, from, gear) {
  let at = from;
  for (let step = brakingSteps(game, body); step > 0; step--) {
    const next = move(body, at, gear, game.dt);
    yield [at, next];
    if (at.v === 0 && next.v === 0) return; // it stays where it is
    at = next;
  }
}

/** Least clearance [m] during an action and the best of three ways to brake to rest after it. */
export function roomAfter(game, body, robot, action) {
  const after = move(body, robot, action, game.dt);
  const room = clearanceAlong(game.arena, robot, after);
  const escapes = ESCAPES.map((gear) => {
    let least = room;
    for (const [at, next] of braking(game, body, after, gear)) least = Math.min(least, clearanceAlong(game.arena, at, next));
    return least;
  });
  return Math.max(...escapes) - body.radius;
}

/** Whether that is as much as the shield wants, looked for no longer than it takes to know. */
export function leavesRoom(game, body, robot, action) {
  const { arena, dt } = game;
  const after = move(body, robot, action, dt);
  const wanted = body.radius + MARGIN;
  if (clearanceAlong(arena, robot, after) <= wanted) return false;
  const longest = after.v ** 2 / (2 * body.u1_max) + after.v * dt; // of the ways to rest; a clearance falls no faster
  if (!arena.map && body.v_min >= 0 && clearance(arena, after.x, after.y) - longest > wanted) return true;
  return ESCAPES.some((gear) => {
    for (const [at, next] of braking(game, body, after, gear)) if (clearanceAlong(arena, at, next) <= wanted) return false;
    return true;
  });
}
