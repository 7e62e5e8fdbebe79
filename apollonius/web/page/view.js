// What one robot sees, as it is: bodies, states and the arena, as in `apollonius/observe/view.py`.

import { other } from "./rules.js";
import { bodiesOf, byDistance } from "./teams.js";

/**
 * What one robot sees in a state of a game.
 *
 * @param who {role, number} of the robot
 * @returns {game, role, own, mates, opponents, opponent}: robots are {body, state}; the opponent is the nearest of those in play
 */
export function look(game, state, { role, number }) {
  const robots = (side) => bodiesOf(game, side).map((body, index) => ({ body, state: state[side][index] }));
  const [ours, opponents] = [robots(role), robots(other(role))];
  const own = ours[number];
  const [opponent = opponents[0]] = byDistance(own.state, opponents);
  return { game, role, own, mates: ours.toSpliced(number, 1), opponents, opponent };
}
