// Players by name: people, trained agents, rules, and the shield before any of them.
//
// Robots are the same at every difficulty: an easier opponent sees late, the hardest one sees what the other is about to do.
// Neither changes how a player sees its own robot, so that a shield stays a shield.

import { BUILT_IN, atBest, byValues, shielded, valuesOf } from "./agents.js";
import { CLASSICAL, fits, step } from "./calls.js";
import { findAgent, isOwn } from "./files.js";
import { ACTIONS, HOLD, ROLES, other, winner } from "./game.js";
import { SHIELDED, YOU, bare, inWords, leadAndMates } from "./names.js";

const HELD = 5; // steps for which an action is held in what is foreseen
const TRIED = 4; // of the best actions
const DECIDED = 1000; // what a game is worth that is won within them; more than any network says

/** Difficulties, from gentle to hardest: label, delay of what is seen [s], whether the opponents' actions are observed. */
export const DIFFICULTIES = {
  gentle: { words: "gentle: sees where you were a second ago", late: 1 },
  fair: { words: "fair: sees where you were half a second ago", late: 0.5 },
  sharp: { words: "sharp: sees you at once", late: 0 },
  told: { words: "knows you: sees which keys you hold", late: 0, isTold: true },
};

/**
 * A player as good as a difficulty says.
 *
 * @param player from (game, state, who) to actions in the order it prefers them
 * @param difficulty a name in `DIFFICULTIES`
 * @param worth what a state is worth to it, if it knows: from (game, state, who) to a number
 * @returns from (game, state, who, states, told) to actions; `states` are all of the game, `told` are the opponents' actions
 */
export function asHardAs(player, difficulty, worth = null) {
  const { late, isTold } = DIFFICULTIES[difficulty];
  if (isTold) return foreseeing(player, worth);
  return late ? seeingLate(player, late) : player;
}

/** Sees the opponents where they were some seconds ago, but not ones in play that are no more. */
function seeingLate(player, seconds) {
  return (game, state, who, states) => {
    const rival = other(who.role);
    const before = states[Math.max(0, states.length - 1 - Math.round(seconds / game.dt))];
    const late = before[rival].map((robot, number) => ({ ...robot, status: state[rival][number].status }));
    return player(game, { ...state, [rival]: late }, who);
  };
}

/** Tries its best actions against those that the opponents take, while its mates go straight; prefers those that lead to more. */
function foreseeing(player, worth) {
  return (game, state, who, states, told) => {
    const { role, number } = who;
    const actions = player(game, state, who);
    const mates = state[role].map(() => HOLD);
    const value = (action) => afterHolding(game, state, who, { [role]: mates.with(number, action), [other(role)]: told }, worth);
    const tried = actions.slice(0, TRIED).map((action) => ({ action, value: value(action) }));
    const best = tried.toSorted((one, two) => two.value - one.value).map(({ action }) => action);
    return [...best, ...actions.slice(TRIED)];
  };
}

/** Return the value of the state after all have held their actions; without a `worth`, only a win by then counts. */
function afterHolding(game, state, who, actions, worth) {
  for (let held = 0; held < HELD; held++) {
    const after = step(game, state, actions);
    if (after.outcome !== "ongoing") {
      const won = winner(game, after.outcome);
      return won === null ? 0 : won === who.role ? DECIDED - held : held - DECIDED;
    }
    state = after.state;
  }
  return worth ? worth(game, state, who) : 0;
}

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

/** Return the names of a side's players that need no file and can play in a game with these numbers of robots. */
export function ruleNames(side, game, counts) {
  return [...Object.keys(CLASSICAL[side]).filter((name) => fits(name, game, counts[0])), ...Object.keys(BUILT_IN)];
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
  if (isOwn(catalogue, name)) return { player: (...seen) => [agent(...seen), ...ACTIONS], values: null, isLearned: false };
  return { player: atBest(agent), values: valuesOf(agent), isLearned: true };
}
