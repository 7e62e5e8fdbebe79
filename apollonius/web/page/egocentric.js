// What a robot sees from where it is, in its own frame: function by function `apollonius/observe/egocentric.py`.

import { FARTHEST } from "./chart.js";
import { chartOf } from "./charting.js";
import { clip } from "./clearance.js";

const RAYS = 32; // directions in which it is looked how far a wall or an obstacle is
const COURSES = 16; // directions, every other one of those, in which it is looked how far the opponent would have to go
const [NEAR, AHEAD] = [1.5, 5]; // how far in them [m], before an obstacle
const BEFORE = 0.1; // how far before it [m]
const SHARPNESS = 4; // how much the best direction counts more than one along which nothing is gained
export const UNITS = { speed: 1.2, u1: 0.3, u2: 0.8, length: 0.3 }; // of the limits: those of the paper's robots

/** Ninety-two numbers: the robots, rays and ways. */
export function egocentric({ game, own: looking, opponent: nearest }) {
  const chart = chartOf(game);
  const robots = [looking, nearest];
  const [own, opponent] = robots.map(({ state }) => state);
  const [dx, dy] = [opponent.x - own.x, opponent.y - own.y];
  const away = { dx, dy, distance: Math.hypot(dx, dy) };
  const rays = Array.from({ length: RAYS }, (_, index) => {
    const angle = own.heading + index * ((2 * Math.PI) / RAYS);
    const [cos, sin] = [Math.cos(angle), Math.sin(angle)];
    return { cos, sin, range: chart.range(own.x, own.y, cos, sin) };
  });
  return [
    ...ofRobots(game, chart, robots, away),
    ...rays.map(({ range }) => 1 / (1 + Math.max(range - robots[0].body.radius, 0))),
    ...ofWays(chart, robots, away, rays.filter((_, index) => index % (RAYS / COURSES) === 0)),
  ];
}

/** What is seen of both robots. */
function ofRobots(game, chart, [own, other], { dx, dy, distance }) {
  const [[cos, sin], [theirCos, theirSin]] = [own, other].map(({ state }) => [
    Math.cos(state.heading),
    Math.sin(state.heading),
  ]);
  const far = Math.max(distance, 1e-6);
  return [
    ...motion(own),
    own.body.v_min / UNITS.speed,
    ...rooms(chart, own, cos, sin),
    (cos * dx + sin * dy) / far,
    (cos * dy - sin * dx) / far,
    ...ofLength(distance),
    clip(distance - game.capture_distance, 0, 3) / 3,
    cos * theirCos + sin * theirSin,
    cos * theirSin - sin * theirCos,
    ...motion(other),
    ...rooms(chart, other, theirCos, theirSin),
    game.capture_distance / UNITS.length,
  ];
}

function motion({ body, state }) {
  const { speed, u1, u2, length } = UNITS;
  return [state.v / speed, body.v_max / speed, body.u1_max / u1, body.u2_max / u2, body.radius / length];
}

/** Of the body here, and at the point where braking straight ahead would stop it. */
function rooms(chart, { body, state }, cos, sin) {
  const braking = Math.max(state.v, 0) ** 2 / Math.max(2 * body.u1_max, 1e-6);
  const here = chart.room(state.x, state.y);
  const there = chart.room(state.x + braking * cos, state.y + braking * sin);
  return [here, there].map((room) => clip(room - body.radius, -1, 1));
}

/** A length [m] on two scales, one that tells near ones apart and one for all. */
export const ofLength = (length) => [1 / (1 + length), Math.log1p(length) / 2];

/** How far the opponent has to go to the robot, and to places around it. */
function ofWays(chart, [{ state: own, body }, { state: opponent, body: theirBody }], { dx, dy, distance }, courses) {
  const far = Math.max(distance, 1e-6);
  const isSeen = chart.range(own.x, own.y, dx / far, dy / far) >= Math.min(distance, FARTHEST);
  const there = chart.places(opponent.x, opponent.y);
  const here = chart.places(own.x, own.y);
  const stop = there.stops[there.weights.indexOf(Math.max(...there.weights))];
  const whole = chart.wayFrom(stop, here);
  /** How far ahead it is looked in each direction, and the opponent's way to there. */
  const fromAhead = (reach) =>
    courses.map(({ cos, sin, range }) => {
      const along = clip(range - BEFORE, 0, reach);
      return { along, way: chart.wayFrom(stop, chart.places(own.x + along * cos, own.y + along * sin)) };
    });
  const longer = fromAhead(NEAR).map(({ way }) => clip((way - whole) / NEAR, -1, 1));
  const first = fromAhead(AHEAD).map(({ along, way }) => {
    const [mine, later] = [along * theirBody.v_max, way * body.v_max];
    return (later - mine) / (later + mine + 1e-3);
  });
  const gains = longer.map((share) => Math.exp(-SHARPNESS * share));
  const total = gains.reduce((sum, gain) => sum + gain);
  const shorter = [Math.cos, Math.sin].map((part) =>
    gains.reduce((sum, gain, index) => sum + (gain / total) * part((index * 2 * Math.PI) / COURSES), 0),
  );
  const length = isSeen ? distance : chart.way(there, here);
  return [isSeen ? 1 : 0, ...ofLength(length), ...longer, ...shorter, ...first];
}
