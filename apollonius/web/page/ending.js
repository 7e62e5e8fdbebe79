// What a person is told: who they are and what to do, and how a game ended.

import { levelWonBy } from "./levels.js";
import { EVADER, PURSUER } from "./rules.js";

const COLOUR = { [PURSUER]: "red", [EVADER]: "blue" };

const YOURS = {
  captured: { [PURSUER]: "You caught it", [EVADER]: "You were caught" },
  pursuer_hit_obstacle: { [PURSUER]: "You hit an obstacle", [EVADER]: "Red hit an obstacle" },
  evader_hit_obstacle: { [PURSUER]: "Blue hit an obstacle", [EVADER]: "You hit an obstacle" },
  pursuer_out_of_range: { [PURSUER]: "You ran into a wall", [EVADER]: "Red ran into a wall" },
  evader_out_of_range: { [PURSUER]: "Blue ran into a wall", [EVADER]: "You ran into a wall" },
  both_failed: { [PURSUER]: "You both crashed at once", [EVADER]: "You both crashed at once" },
  no_result: { [PURSUER]: "Time is up, it got away", [EVADER]: "You survived" },
  territory_reached: { [PURSUER]: "Blue reached the ring", [EVADER]: "You reached the ring" },
};
const THEIRS = {
  captured: "Red caught blue",
  pursuer_hit_obstacle: "Red hit an obstacle",
  evader_hit_obstacle: "Blue hit an obstacle",
  pursuer_out_of_range: "Red ran into a wall",
  evader_out_of_range: "Blue ran into a wall",
  both_failed: "Both crashed at once",
  no_result: "Time is up, blue got away",
  territory_reached: "Blue reached the ring",
};

const limit = ({ game }) => `${Number((game.max_steps * game.dt).toFixed(1))}\u00a0s`;

/** What is to be done. `me` is the side of the one person who plays, or null. */
export function describeGoal(match, me) {
  const { game, players } = match;
  if (me === EVADER && game.arena.territory) return `You are blue: reach the ring within ${limit(match)}`;
  if (me === EVADER) return `You are blue: survive ${limit(match)}`;
  if (me === PURSUER && game.arena.territory) return `You are red: keep blue from the ring for ${limit(match)}`;
  if (me === PURSUER) return `You are red: catch blue within ${limit(match)}`;
  const [red, blue] = [PURSUER, EVADER].map((role) => players[role].words);
  return red === blue ? "Red hunts, blue flees" : `Red ${red}; blue ${blue}`;
}

/** How a game that is over ended, and who has won. */
export function describeEnd(match, me) {
  const { outcome, winner } = match;
  const what = me ? YOURS[outcome][me] : THEIRS[outcome];
  const when = `after ${match.seconds.toFixed(1)}\u00a0s`;
  if (winner === null) return `${what} ${when}: nobody wins.`;
  if (!me) return `${what} ${when}: ${COLOUR[winner]} wins.`;
  return winner === me ? `${what} ${when}. You win!` : `${what} ${when}. You lose.`;
}

/** Until when a person who crashed could still have braked; nothing where that is not known. */
export function describeLoss({ game }, last) {
  return last === null ? "" : `Until ${(last * game.dt).toFixed(1)}\u00a0s you could have braked in time.`;
}

/** How a game is begun and steered by so many people. */
export function describeReady(people) {
  const touch = matchMedia("(pointer: coarse)").matches;
  const how = people ? (touch ? "hold the pad to steer" : "arrow keys to steer") : "two agents play";
  return `${touch ? "Start" : "Space"} to begin; ${how}`;
}

/** What the button that goes on says in a session. */
export function describeGo(session) {
  const { phase, match, me } = session;
  if (phase !== "over") return { counting: "Pause", playing: "Pause", paused: "Go on" }[phase] ?? "Start";
  if (levelWonBy(session, me)) return "Next level";
  return me && match.winner !== me ? "Try again" : "Next game";
}
