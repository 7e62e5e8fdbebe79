// Why a game goes as it goes, worked out beside it: what agents value, where robots can still stop, who is first where,
// what is to be expected. Each is a layer that can be shown.

import { leavesRoom } from "./agents.js";
import { STOPS } from "./chart.js";
import { chartOf } from "./charting.js";
import { decided } from "./match.js";
import { EVADER, HOLD, ROLES, move, step } from "./rules.js";
import { bodyOf, isActive, robotOf, robotsOf } from "./teams.js";

const ACTIONS = [0, 1, 2, 3, 4, 5, 6, 7, 8];
const HELD = 1; // for how long actions are held to show where they lead [s]
const AHEAD = 2; // how far is looked ahead [s]
const BUDGET = 1; // for looking ahead, in a frame [ms]
const NO_WAY = 655; // what is at least as long is no way [m]

/** What can be shown, by its key: what it means, in words. */
export const LAYERS = {
  values: "Values: the larger a dot, the better an agent thinks of going there",
  brakes: "Brakes: crosses where it could then no longer stop in time",
  regions: "Regions: blue where blue is first, by the shortest way at full thrust; turns are left out",
  course: "Course: where both go within two seconds, if people go on as they do now",
};

/** Where each action leads a robot that holds it for a while. */
function ends(game, body, robot) {
  const held = Math.max(1, Math.round(HELD / game.dt));
  return ACTIONS.map((action) => {
    let end = robot;
    for (let count = 0; count < held; count++) end = move(body, end, action, game.dt);
    return end;
  });
}

/** What an agent thinks of the nine actions, from 0, the worst, to 1, the best; null of one that says nothing. */
function opinions({ values }, game, state, who) {
  if (!values) return null;
  const found = [...values(game, state, who)];
  const [least, most] = [Math.min(...found), Math.max(...found)];
  return found.map((value) => (value - least) / Math.max(most - least, 1e-9));
}

/** Which actions leave a robot room to stop: what the shield lets pass. */
export const stoppable = (game, body, robot) => ACTIONS.map((action) => leavesRoom(game, body, robot, action));

/** Whether a robot is out of play as it touched a wall or an obstacle. */
export const hasCrashed = (state, who) => ["hit_obstacle", "out_of_range"].includes(robotOf(state, who).status);

/**
 * The last state of a game, as its number, from which a robot, {role, number}, that crashed could still have braked in time;
 * null where it did not crash, or never could.
 */
export function lastBrake({ game, state, states }, who) {
  if (!hasCrashed(state, who)) return null;
  const isInTime = (robot) => isActive(robot) && stoppable(game, bodyOf(game, who), robot).includes(true);
  const last = states.findLastIndex((state) => isInTime(robotOf(state, who)));
  return last < 0 ? null : last;
}

/** The time [s] that a body takes for a way [m] at full thrust from a speed. */
export function timeFor(body, speed, way) {
  const v = Math.max(speed, 0);
  const thrust = Math.max(body.u1_max, 1e-6);
  const ramp = (body.v_max ** 2 - v ** 2) / (2 * thrust); // until it is at its top speed [m]
  if (way < ramp) return (Math.sqrt(v ** 2 + 2 * thrust * way) - v) / thrust;
  return (body.v_max - v) / thrust + (way - ramp) / body.v_max;
}

/**
 * Which side is first at each stop of the arena's chart, row by row from the bottom: seconds by which an evader is earlier
 * than any pursuer's reach; NaN where no way leads.
 */
export function leads(game, state) {
  const chart = chartOf(game);
  const runners = (role) => {
    return robotsOf(state, [role]).filter((who) => isActive(robotOf(state, who))).map((who) => {
      const { x, y, v } = robotOf(state, who);
      const { stops, weights } = chart.places(x, y);
      const from = stops.map((stop, index) => ({ lengths: weights[index] ? chart.ways.from(stop) : null, weight: weights[index] }));
      return { body: bodyOf(game, who), v, from };
    });
  };
  const [pursuers, evaders] = ROLES.map(runners);
  const way = (from, stop) => from.reduce((sum, { lengths, weight }) => (lengths ? sum + (weight * lengths[stop]) / 100 : sum), 0);
  /** The time of the first of some robots to come so near to a stop. */
  const first = (robots, stop, reach) => {
    return robots.reduce((least, { body, v, from }) => {
      const length = way(from, stop);
      return length < NO_WAY ? Math.min(least, timeFor(body, v, Math.max(length - reach, 0))) : least;
    }, Infinity);
  };
  return Float32Array.from({ length: STOPS ** 2 }, (_, stop) => first(pursuers, stop, game.capture_distance) - first(evaders, stop, 0));
}

/** Looks ahead a little in every frame; `course` is what it has last seen to its end: states, from where it began. */
class Foresight {
  constructor(match) {
    Object.assign(this, { match, course: [], states: null, begins: 0 });
  }

  look() {
    const { match } = this;
    if (!this.states) [this.states, this.begins] = [[...match.states], match.states.length - 1];
    const until = performance.now() + BUDGET;
    const last = this.begins + Math.round(AHEAD / match.game.dt);
    let isOver = match.isOver;
    while (!isOver && this.states.length <= last && performance.now() < until) isOver = this.#step();
    if (isOver || this.states.length > last) [this.course, this.states] = [this.states.slice(this.begins), null];
  }

  #step() {
    const { game, players, actions } = this.match;
    const { states } = this;
    const state = states.at(-1);
    const held = ({ role, number }) => actions.at(-1)?.[number + (role === EVADER ? state.pursuer.length : 0)] ?? HOLD;
    const taken = decided(players, states, ({ rank }, who, told) => (rank ? rank(game, state, who, states, told)[0] : held(who)));
    const after = step(game, state, taken);
    this.states.push(after.state);
    return after.outcome !== "ongoing";
  }
}

/** What is known of a match beside its rules: worked out once for each of its states, by the layers that are wanted. */
export class Insight {
  constructor(match) {
    Object.assign(this, { match, state: null, wanted: "", found: null, foresight: new Foresight(match) });
  }

  /**
   * What the layers show now.
   *
   * @param shown keys of `LAYERS`
   * @returns {robots, leads, course}: of each robot in play {role, number, ends, values, stops}, what is not shown or not known is null
   */
  of(shown) {
    const { match } = this;
    const { game, players, state } = match;
    if (state !== this.state || shown.join() !== this.wanted) {
      [this.state, this.wanted] = [state, shown.join()];
      const robots = robotsOf(state, ROLES).filter((who) => isActive(robotOf(state, who))).map((who) => ({
        ...who,
        ends: ends(game, bodyOf(game, who), robotOf(state, who)),
        values: shown.includes("values") ? opinions(robotOf(players, who), game, state, who) : null,
        stops: shown.includes("brakes") ? stoppable(game, bodyOf(game, who), robotOf(state, who)) : null,
      }));
      this.found = { robots, leads: shown.includes("regions") ? leads(game, state) : null };
    }
    if (shown.includes("course")) this.foresight.look();
    return { ...this.found, course: shown.includes("course") ? this.foresight.course : null };
  }
}
