// Players by name: people, trained agents, rules, and the shield before any of them.
//
// Robots are the same at every difficulty: an easier opponent sees the other side late. Its own robot it always sees as it is,
// so that a shield stays a shield.

import { BUILT_IN, atBest, byValues, shielded, valuesOf } from "./agents.js";
import { CLASSICAL, fits } from "./calls.js";
import { findAgent, isOwn } from "./files.js";
import { ACTIONS, EVADER, PURSUER, other } from "./game.js";
import { SHIELDED, YOU, bare, inWords } from "./words.js";

const MATES = { [PURSUER]: `${SHIELDED}P_team`, [EVADER]: `${SHIELDED}E_any` }; // whom a person leads

/** Difficulties, the gentlest first: label, delay of what is seen [s]. */
export const DIFFICULTIES = {
  gentle: { words: "gentle: sees where you were a second ago", late: 1 },
  fair: { words: "fair: sees where you were half a second ago", late: 0.5 },
  sharp: { words: "sharp: sees you at once", late: 0 },
};

/**
 * A player that sees the opponents where they were some seconds ago, but none in play that is no more.
 *
 * @param player from (game, state, who) to actions in the order it prefers them
 * @returns from (game, state, who, states) to such actions; `states` are all of the game
 */
export function seeingLate(player, seconds) {
  return (game, state, who, states) => {
    const rival = other(who.role);
    const before = states[Math.max(0, states.length - 1 - Math.round(seconds / game.dt))];
    const late = before[rival].map((robot, number) => ({ ...robot, status: state[rival][number].status }));
    return player(game, { ...state, [rival]: late }, who);
  };
}

/** Return the names of a side's players that need no file and can play in a game with these numbers of robots. */
export function ruleNames(side, game, counts) {
  return [...Object.keys(CLASSICAL[side]).filter((name) => fits(name, game, counts[0])), ...Object.keys(BUILT_IN)];
}

/** Return who plays each of the robots of one side: all are alike, but for the mates of a person. */
export async function findTeam(catalogue, name, role, count, difficulty, steer) {
  const first = await findPlayer(catalogue, name, role, difficulty, steer);
  const mate = name === YOU && count > 1 ? await findPlayer(catalogue, MATES[role], role, "sharp") : first;
  return Array.from({ length: count }, (_, number) => (number ? mate : first));
}

/**
 * Who plays a robot of one side.
 *
 * @param catalogue of the page
 * @param name of the player; `shielded:` may stand before it
 * @param role the side
 * @param difficulty a name in `DIFFICULTIES`
 * @param steer what a person does: from a side and what a player is given to an action
 * @returns {name, words, act, values}: `values` are what it thinks of the nine actions; null of people, and of who has no opinion
 */
export async function findPlayer(catalogue, name, role, difficulty, steer) {
  if (name === YOU) return { name, words: inWords(name), values: null, act: (...seen) => steer(role, ...seen) };
  const known = bare(name);
  const { player, values } = await findBare(catalogue, known, role);
  const { late } = DIFFICULTIES[difficulty];
  const seeing = late ? seeingLate(player, late) : player;
  const ranked = name === known ? seeing : shielded(seeing);
  const [called, words] = late ? [`${name} (${difficulty})`, `${inWords(name)}, ${difficulty}`] : [name, inWords(name)];
  return { name: called, words, values, act: (...seen) => ranked(...seen)[0] };
}

async function findBare(catalogue, name, role) {
  if (Object.hasOwn(BUILT_IN, name)) return { player: BUILT_IN[name], values: null };
  if (Object.hasOwn(CLASSICAL[role], name)) return { player: byValues(CLASSICAL[role][name]), values: CLASSICAL[role][name] };
  const agent = await findAgent(catalogue, name);
  if (isOwn(catalogue, name)) return { player: (...seen) => [agent(...seen), ...ACTIONS], values: null };
  return { player: atBest(agent), values: valuesOf(agent) };
}
