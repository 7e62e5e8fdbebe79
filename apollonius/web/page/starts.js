// Where games begin: the same distribution as in `apollonius/game/starts.py`, from random numbers of the page's own.

import { clearance, startMovers } from "./calls.js";
import { EVADER, PURSUER, ROLES, bodiesOf, bySide, countsOf, moversOf, other } from "./game.js";
import { TRIES } from "./movers.js";

/** Numbers uniform in [0, 1) from a seed: mulberry32. The page's own; the Python rules draw from JAX's. */
export function makeRandom(seed) {
  let state = seed >>> 0;
  return () => {
    state = (state + 0x6d2b79f5) >>> 0;
    let bits = Math.imul(state ^ (state >>> 15), state | 1);
    bits ^= bits + Math.imul(bits ^ (bits >>> 7), bits | 61);
    return ((bits ^ (bits >>> 14)) >>> 0) / 2 ** 32;
  };
}

const [PAIRS, DRAWS, STARTS] = [20_000, 1000, 100]; // of the first robots, of a team mate, and of those before it

/**
 * An initial state: uniform over the pairs of places with room, then mate by mate over what is left; headings uniform, as
 * slow as the robots can be. Throws an Error where the arena has no room for all robots.
 */
export function drawStart(game, random) {
  for (let start = 0; start < STARTS; start++) {
    const state = drawPair(game, random);
    if (ROLES.every((role) => bodiesOf(game, role).slice(1).every((body) => drawMate(game, random, state, role, body)))) return state;
  }
  throw new Error(`the arena has no room for ${countsOf(game).join(" v ")}: take fewer robots, or a larger arena`);
}

const MARGIN = 2e-3; // room that walkers leave at the start besides their radius [m]

/** A start with the movers of its game, if there are any and it has none: walkers anywhere on the floor, the others at any time. */
export function withMovers(game, state, random) {
  if (!game.movers || state.movers) return state;
  const walkers = moversOf(game).filter(({ kind }) => kind === "walkers");
  const places = walkers.map(({ radius }) => Array.from({ length: TRIES }, () => drawFloor(game, random, radius + MARGIN)));
  return { ...state, movers: startMovers(game, state, places, random) };
}

/** A place [x, y] with room [m] to obstacles and walls. */
function drawFloor(game, random, room) {
  for (let draw = 0; draw < PAIRS; draw++) {
    const { x, y } = drawRobot(game, random, game.pursuer);
    if (clearance(game.arena, x, y) >= room) return [x, y];
  }
  throw new Error("the arena leaves the walkers no place: make the obstacles or the walkers smaller, or the arena larger");
}

/** A robot anywhere in the arena. */
function drawRobot({ arena, starts }, random, body) {
  const within = (low, high) => low + (high - low) * random();
  return {
    x: Math.fround(within(arena.x_min, arena.x_max)),
    y: Math.fround(within(arena.y_min, arena.y_max)),
    v: starts.speed === "moving" ? Math.fround(within(body.v_min, body.v_max)) : Math.max(body.v_min, 0),
    heading: Math.fround(within(-Math.PI, Math.PI)),
    status: "active",
  };
}

const separation = (one, two) => Math.hypot(one.x - two.x, one.y - two.y);

/** Return whether a robot is far enough from walls and obstacles and, if it is an evader, from the territory. */
function hasRoom({ arena, starts }, robot, role, body) {
  if (clearance(arena, robot.x, robot.y) < starts.clearance + body.radius) return false;
  const { territory: goal } = arena;
  return role === PURSUER || !goal || separation(robot, goal) >= goal.radius + starts.separation;
}

/** The first robots of both sides. */
function drawPair(game, random) {
  for (let draw = 0; draw < PAIRS; draw++) {
    const [pursuer, evader] = ROLES.map((role) => drawRobot(game, random, game[role]));
    const areIn = hasRoom(game, pursuer, PURSUER, game.pursuer) && hasRoom(game, evader, EVADER, game.evader);
    if (areIn && separation(pursuer, evader) >= game.starts.separation) return { pursuer: [pursuer], evader: [evader], steps: 0 };
  }
  throw new Error("the arena leaves the robots no place to start: make the obstacles or the robots smaller, or the arena larger");
}

/** One more robot of a side, put into the state; returns whether there is room for it. */
function drawMate(game, random, state, role, body) {
  const { starts } = game;
  const bodies = bodiesOf(game, role);
  for (let draw = 0; draw < DRAWS; draw++) {
    const robot = drawRobot(game, random, body);
    const isClear = state[role].every((mate, number) => separation(robot, mate) >= starts.clearance + body.radius + bodies[number].radius);
    const isFar = state[other(role)].every((opponent) => separation(robot, opponent) >= starts.separation);
    if (!isClear || !isFar || !hasRoom(game, robot, role, body)) continue;
    state[role].push(robot);
    return true;
  }
  return false;
}
