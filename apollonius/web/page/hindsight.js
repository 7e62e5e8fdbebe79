// After a loss that was no crash: from when another in the person's place would have done no better. Games are played on
// from states that were recorded, by the rules and against the very players of the match, so that a way out that is found
// is one.

import { EVADER, PURSUER, ROLES, isActive, other, robotOf } from "./game.js";
import { SHIELDED, bare } from "./names.js";
import { findTeam } from "./players.js";

export const STAND_IN = { [PURSUER]: "P_any", [EVADER]: "E_any" }; // who takes the person's place, shielded
const GIVEN = { [PURSUER]: 20, [EVADER]: 10 }; // how long a pursuer has to win, and an evader to stay free [s]
const FARTHEST = 20; // how far back it is looked [s]

/**
 * Who tries in the place of a robot, {role, number}: as it sees the game and, where no opponent is told what it does,
 * as one who is told what opponents do. Nobody where a player acts by chance, as it would then act otherwise.
 */
export async function standIns(catalogue, match, { role }) {
  const players = ROLES.flatMap((side) => match.players[side]);
  if (!Object.hasOwn(catalogue.files, STAND_IN[role]) || players.some(({ name }) => bare(name).startsWith("random"))) return [];
  const isWatched = match.players[other(role)].some(({ isTold }) => isTold);
  const find = (hard) => findTeam(catalogue, SHIELDED + STAND_IN[role], role, 1, hard, null, (work) => work());
  return (await Promise.all((isWatched ? ["sharp"] : ["sharp", "told"]).map(find))).flat();
}

/**
 * Look for the last state of a match, as its number, from which one of some stand-ins for a robot would have stayed free for
 * ten seconds or, a pursuer, have won: half as far back again from the loss each time, then by halves between that state and
 * the one tried before. It goes on by one step of a game whenever it is asked.
 *
 * @returns {number, seconds}: what was found, null if nothing; how far back it was looked
 */
export function* lastChance(match, who, stands) {
  const { dt } = match.game;
  const gone = match.states.findIndex((state) => !isActive(robotOf(state, who)));
  const end = gone < 0 ? match.states.length - 1 : gone;
  const first = Math.max(0, end - Math.round(FARTHEST / dt));
  let [found, lost] = [null, end];
  while (found === null && lost > first) {
    const number = Math.max(first, end - Math.floor(1.5 * (end - lost)) - 1);
    if (yield* someoneDoesBetter(match, number, who, stands)) found = number;
    else lost = number;
  }
  while (found !== null && lost - found > 1) {
    const number = Math.floor((found + lost) / 2);
    if (yield* someoneDoesBetter(match, number, who, stands)) found = number;
    else lost = number;
  }
  return { number: found, seconds: (end - (found ?? first)) * dt };
}

function* someoneDoesBetter(match, number, who, stands) {
  for (const stand of stands) if (yield* doesBetter(match, number, who, stand)) return true;
  return false;
}

/** Return whether a stand-in does better from a state on. */
function* doesBetter(match, number, who, stand) {
  const players = { ...match.players, [who.role]: match.players[who.role].with(who.number, stand) };
  const tried = match.from(number, players);
  const last = number + Math.round(GIVEN[who.role] / match.game.dt);
  const isCaught = () => who.role === EVADER && !isActive(robotOf(tried.state, who));
  while (!tried.isOver && !isCaught() && tried.states.length <= last) {
    tried.step();
    yield;
  }
  return !isCaught() && (tried.isOver ? tried.winner === who.role : who.role === EVADER);
}
