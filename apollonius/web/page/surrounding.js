// Pursuers that surround the evader as a team, by the area that is left to it or by their bearings around it: function by
// function `apollonius/agents/surrounding.py`. From what one robot sees to a heading [rad] and a speed [m/s] to have.

import { STOPS } from "./chart.js";
import { chartOf } from "./charting.js";
import { clip } from "./clearance.js";
import { arcSpeed, direction, facingSpeed, separation } from "./driving.js";
import { isActive } from "./teams.js";

const DIRECTIONS = 16; // in which it is looked ahead
const [AHEAD, NEAR] = [0.75, 1.6]; // how far it is looked, and the way to the evader from which on it is headed for [m]
const SHARPNESS = 8; // how much the best direction counts more than the others
const STRIDE = 2; // of the chart's stops every so many are places whose owner is asked for
const BESIDE = 0.2; // weight of the way to the evader beside the area [m]
const CLOSING = 0.7; // radius of the circle to be on, as a share of the pursuers' mean distance from the evader
const NO_WAY = 655; // what is at least as long is no way [m]

/** Shrinks the part of the arena that the evader reaches first (Huang, Zhang, Ding, Stipanovic and Tomlin, 2011). */
export const voronoiPursuit = downwards(areaLeft);

/** Takes its own bearing around the evader, evenly apart from its mates' (Kim and Sugie, 2007). */
export const encirclement = downwards(wayToBearing);

/** Where a cost of places falls, as fast as the turn still to be made allows; close to the evader straight at it. */
function downwards(costOf) {
  return (seen) => {
    const { game, body, own, opponent } = seen;
    const chart = chartOf(game);
    if (wayTo(chart, opponent)(own) < NEAR) return [direction(own, opponent), arcSpeed(body, own, opponent)];
    const cost = costOf(seen, chart);
    const tried = Array.from({ length: DIRECTIONS }, (_, index) => {
      const angle = (index * 2 * Math.PI) / DIRECTIONS;
      const [cos, sin] = [Math.cos(angle), Math.sin(angle)];
      const along = clip(chart.range(own.x, own.y, cos, sin) - body.radius, 0, AHEAD);
      return { cos, sin, cost: cost({ x: own.x + along * cos, y: own.y + along * sin }) };
    });
    const costs = tried.map((one) => one.cost);
    const [worst, best] = [Math.max(...costs), Math.min(...costs)];
    const weight = (one) => ((worst - one.cost) / Math.max(worst - best, 1e-6)) ** SHARPNESS;
    const [x, y] = ["cos", "sin"].map((part) => tried.reduce((sum, one) => sum + weight(one) * one[part], 0));
    const heading = Math.atan2(y, x);
    return [heading, facingSpeed(body, own, heading)];
  };
}

/** What it costs to be at a place: the area [m^2] that the evader then reaches first, and a little of the way to it [m]. */
function areaLeft({ body, opponent, opponentBody, mates }, chart) {
  const theirs = toAll(chart, opponent);
  const cell = ((chart.side * STRIDE) / STOPS) ** 2;
  const blur = Math.sqrt(cell) / body.v_max;
  const deadline = theirs.map(() => Infinity);
  for (const mate of mates.filter(({ state }) => isActive(state))) {
    toAll(chart, mate.state).forEach((way, place) => (deadline[place] = Math.min(deadline[place], way / mate.body.v_max)));
  }
  const way = wayTo(chart, opponent);
  return (here) => {
    const own = toAll(chart, here);
    let area = 0;
    for (let place = 0; place < own.length; place++) {
      if (theirs[place] >= NO_WAY) continue;
      const first = Math.min(deadline[place], own[place] / body.v_max) - theirs[place] / opponentBody.v_max;
      area += cell / (1 + Math.exp(-first / blur));
    }
    return area + BESIDE * way(here);
  };
}

/** What it costs to be at a place: the way [m] to that on the circle which is the robot's own. */
function wayToBearing({ game: { arena }, own, opponent, mates }, chart) {
  const team = [own, ...mates.map(({ state }) => state).filter(isActive)];
  const bearing = evenBearing(team.map((robot) => direction(opponent, robot)));
  const radius = (CLOSING * team.reduce((sum, robot) => sum + separation(opponent, robot), 0)) / team.length;
  const x = clip(opponent.x + radius * Math.cos(bearing), arena.x_min, arena.x_max);
  const y = clip(opponent.y + radius * Math.sin(bearing), arena.y_min, arena.y_max);
  return wayTo(chart, { x, y });
}

/** The first of the bearings [rad] evenly apart, in the same order, that are nearest to these. */
function evenBearing(bearings) {
  const slot = (bearing) => (bearings.filter((one) => one < bearing).length * 2 * Math.PI) / bearings.length;
  const [cos, sin] = [Math.cos, Math.sin].map((part) => bearings.reduce((sum, one) => sum + part(one - slot(one)), 0));
  return slot(bearings[0]) + Math.atan2(sin, cos);
}

/** The length [m] of the way from a place to another. */
function wayTo(chart, end) {
  const there = chart.places(end.x, end.y);
  return ({ x, y }) => chart.way(chart.places(x, y), there);
}

/** Lengths [m] of the ways from a place to places all over the arena. */
function toAll(chart, { x, y }) {
  const { stops, weights } = chart.places(x, y);
  const side = STOPS / STRIDE;
  const found = new Float64Array(side ** 2);
  stops.forEach((stop, index) => {
    if (!weights[index]) return;
    const lengths = chart.ways.from(stop);
    for (let place = 0; place < found.length; place++) {
      const at = STRIDE * (Math.floor(place / side) * STOPS + (place % side));
      found[place] += (weights[index] * lengths[at]) / 100;
    }
  });
  return found;
}
