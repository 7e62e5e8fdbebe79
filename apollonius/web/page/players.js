// Players by name, as hard as wanted: people, trained agents, rules, and the shield before any of them.

import { BUILT_IN, atBest, byValues, shielded, valuesOf } from "./agents.js";
import { CLASSICAL, fits } from "./classical.js";
import { DIFFICULTIES, asHardAs } from "./difficulty.js";
import { findAgent } from "./files.js";
import { SHIELDED, YOU, bare, inWords, leadAndMates } from "./names.js";
import { HOLD, ROLES, other } from "./rules.js";

const REHEARSALS = 60; // moves before the first that counts, so that the browser has compiled them

/** Have a match's players think about its start, once for all that are alike, while the opponents hold their course. */
export function rehearse({ game, state, states, players }) {
  for (const role of ROLES) {
    const told = state[other(role)].map(() => HOLD);
    for (const { rank } of new Set(players[role])) {
      const number = players[role].findIndex((player) => player.rank === rank);
      for (let move = 0; rank && move < REHEARSALS; move++) rank(game, state, { role, number }, states, told);
    }
  }
}

/** The names of a side's players that need no file and can play in a game of so many robots. */
export function ruleNames(side, game, counts) {
  return [...Object.keys(CLASSICAL[side]).filter((name) => fits(name, game, counts)), ...Object.keys(BUILT_IN)];
}

/**
 * Who plays each of the robots of one side, so many: a name such as `you+P_team` is a person who leads, and mates that are
 * agents of that name, as sharp as can be; every other name is all of them.
 */
export async function findTeam(catalogue, name, role, count, difficulty, steer, measure) {
  const [lead, mates] = leadAndMates(name);
  const find = (one, hard) => findPlayer(catalogue, one, role, hard, steer, measure);
  const [first, others] = await Promise.all([find(lead, difficulty), mates && find(mates, "sharp")]);
  return Array.from({ length: count }, (_, number) => (number && others) || first);
}

/**
 * Who plays a robot of one side.
 *
 * @param catalogue of the page
 * @param name of the player; `shielded:` may stand before it
 * @param role the side
 * @param difficulty a name in `DIFFICULTIES`
 * @param steer what a person does: from a side to an action
 * @param measure calls a function and keeps how long it took
 * @returns {name, words, isTold, act, rank, values}: `rank` is the player without being measured, and `values` what it
 *   thinks of the nine actions; null of people, and of who has no opinion
 */
async function findPlayer(catalogue, name, role, difficulty, steer, measure) {
  if (name === YOU) return { name, words: inWords(name), isTold: false, rank: null, values: null, act: () => steer(role) };
  const known = bare(name);
  const { player, values, isLearned } = await findBare(catalogue, known, role);
  const worth = isLearned && values ? (...seen) => Math.max(...values(...seen)) : null;
  const asHard = asHardAs(player, difficulty, worth);
  const rank = name.startsWith(SHIELDED) ? shielded(asHard) : asHard;
  const { isTold = false } = DIFFICULTIES[difficulty];
  const full = difficulty === "sharp" ? name : `${name} (${difficulty})`;
  const words = difficulty === "sharp" ? inWords(name) : `${inWords(name)}, ${DIFFICULTIES[difficulty].words.split(":")[0]}`;
  return { name: full, words, isTold, rank, values, act: (...seen) => measure(() => rank(...seen)[0]) };
}

async function findBare(catalogue, name, role) {
  if (Object.hasOwn(BUILT_IN, name)) return { player: BUILT_IN[name], values: null, isLearned: false };
  if (Object.hasOwn(CLASSICAL[role], name)) return { player: byValues(CLASSICAL[role][name]), values: CLASSICAL[role][name], isLearned: false };
  const agent = await findAgent(catalogue, name);
  return { player: atBest(agent), values: valuesOf(agent), isLearned: true };
}
