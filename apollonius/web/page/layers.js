// What can be known of a state of a game by the rules alone: where actions lead and where robots can still stop, and who is
// first where. Each is a layer that can be shown.

import { STOPS, leavesRoom, move, pathsFrom } from "./calls.js";
import { ACTIONS, ROLES, bodyOf, isActive, robotOf, robotsOf } from "./game.js";

const HELD = 1; // for how long actions are held to show where they lead [s]
const NO_PATH = 655; // what is at least as long is no path [m]

/** Labels of the layers. */
export const LAYERS = {
  values: "Values: the larger a dot, the more the agent values that action",
  brakes: "Brakes: crosses mark actions after which the robot could no longer stop in time",
  regions: "Regions: blue where blue arrives first, on the shortest path at full thrust; turns are ignored",
  course: "Course: the next two seconds, if people keep their present action",
};

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
export const stoppable = (game, body, robot) => ACTIONS.map((action) => leavesRoom(game, body, robot, action));

/** The time [s] that a body takes for a way [m] at full thrust from a speed. */
function timeFor(body, speed, way) {
  const v = Math.max(speed, 0);
  const thrust = Math.max(body.u1_max, 1e-6);
  const ramp = (body.v_max ** 2 - v ** 2) / (2 * thrust); // until it is at its top speed [m]
  if (way < ramp) return (Math.sqrt(v ** 2 + 2 * thrust * way) - v) / thrust;
  return (body.v_max - v) / thrust + (way - ramp) / body.v_max;
}

/**
 * Which side is first at each stop of the arena's chart, row by row from the bottom: seconds by which an evader is earlier
 * than any pursuer's reach; NaN where no way leads, or one side is out of play.
 */
export function leads(game, state) {
  const [pursuers, evaders] = ROLES.map((role) => {
    const robots = robotsOf(state, [role]).filter((who) => isActive(robotOf(state, who)));
    return robots.map((who) => ({ body: bodyOf(game, who), speed: robotOf(state, who).v, paths: pathsFrom(game, robotOf(state, who)) }));
  });
  /** The time of the first of some robots to come so near to a stop; not a number where there are none. */
  const first = (robots, stop, reach) => {
    return robots.reduce((least, { body, speed, paths }) => {
      return paths[stop] < NO_PATH ? Math.min(least, timeFor(body, speed, Math.max(paths[stop] - reach, 0))) : least;
    }, robots.length ? Infinity : Number.NaN);
  };
  return Float32Array.from({ length: STOPS ** 2 }, (_, stop) => first(pursuers, stop, game.capture_distance) - first(evaders, stop, 0));
}

/**
 * What layers show of a state.
 *
 * @param shown keys of `LAYERS`
 * @param values from a robot in play, {role, number}, to what it thinks of the nine actions, from 0 to 1, or null
 * @returns {robots, leads}: of each robot in play {role, number, ends, values, stops}; what is not shown or not known is null
 */
export function known(game, state, shown, values = () => null) {
  const robots = robotsOf(state, ROLES).filter((who) => isActive(robotOf(state, who))).map((who) => ({
    ...who,
    ends: ends(game, bodyOf(game, who), robotOf(state, who)),
    values: shown.includes("values") ? values(who) : null,
    stops: shown.includes("brakes") ? stoppable(game, bodyOf(game, who), robotOf(state, who)) : null,
  }));
  return { robots, leads: shown.includes("regions") ? leads(game, state) : null };
}
