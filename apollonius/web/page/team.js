// What a robot sees of two teams: the nearest opponent as in a game of two, and the robots around it one by one. Function by
// function `apollonius/observe/team.py`.

import { chartOf } from "./charting.js";
import { clip } from "./clearance.js";
import { UNITS, egocentric, ofLength } from "./egocentric.js";
import { byDistance } from "./teams.js";

const [MATES, OPPONENTS] = [3, 2]; // mates that are seen, and opponents besides the nearest
const OF_A_ROBOT = 13; // numbers of each of them

/** A hundred and fifty-seven numbers: those of `egocentric`, then those of the other robots in play, zeros of who is not there. */
export function team(view) {
  const { own, mates, opponents, opponent } = view;
  const chart = chartOf(view.game);
  const placed = ({ state }) => ({ state, places: chart.places(state.x, state.y) });
  const [here, there] = [placed(own), placed(opponent)];
  const ownWay = wayBetween(chart, here, there);
  const of = (robots, slots) => {
    const numbers = robots.slice(0, slots).flatMap((robot) => ofRobot(chart, here, there, ownWay, placed(robot)));
    return [...numbers, ...Array(slots * OF_A_ROBOT - numbers.length).fill(0)];
  };
  const [near, far] = [mates, opponents].map((robots) => byDistance(own.state, robots));
  return [...egocentric(view), ...of(near, MATES), ...of(far.slice(1), OPPONENTS)];
}

/** Length [m] of the shortest way between two robots, which is nowhere shorter than their distance. */
function wayBetween(chart, start, end) {
  const away = Math.hypot(end.state.x - start.state.x, end.state.y - start.state.y);
  return Math.max(chart.way(start.places, end.places), away);
}

/** What is seen of a robot besides the nearest opponent, which is `there`. */
function ofRobot(chart, here, there, ownWay, robot) {
  const [own, opponent, other] = [here.state, there.state, robot.state];
  const [cos, sin] = [Math.cos(own.heading), Math.sin(own.heading)];
  const [theirCos, theirSin] = [Math.cos(other.heading), Math.sin(other.heading)];
  const [dx, dy] = [other.x - own.x, other.y - own.y];
  const distance = Math.hypot(dx, dy);
  const far = Math.max(distance, 1e-6);
  const away = [own.x - opponent.x, own.y - opponent.y];
  const across = [other.x - opponent.x, other.y - opponent.y];
  const spread = Math.max(Math.hypot(...away) * Math.hypot(...across), 1e-6);
  const [apart, theirs] = [wayBetween(chart, here, robot), wayBetween(chart, robot, there)];
  const joint = (ownWay + theirs - apart) / Math.max(2 * Math.min(ownWay, theirs), 1e-6);
  return [
    1,
    (cos * dx + sin * dy) / far,
    (cos * dy - sin * dx) / far,
    ...ofLength(distance),
    (other.v * (cos * theirCos + sin * theirSin)) / UNITS.speed,
    (other.v * (cos * theirSin - sin * theirCos)) / UNITS.speed,
    (away[0] * across[0] + away[1] * across[1]) / spread,
    (away[0] * across[1] - away[1] * across[0]) / spread,
    ofLength(apart)[1],
    ...ofLength(theirs),
    clip(joint, 0, 1),
  ];
}
