// How hard an opponent is, in words. The robots are always the same: an easier opponent sees late, the hardest one sees
// what the other is about to do. Neither changes how a player sees its own robot, so that a shield stays a shield.

import { other, step, winner } from "./rules.js";

const HELD = 5; // steps for which an action is held in what is foreseen
const TRIED = 4; // of the best actions
const DECIDED = 1000; // what a game is worth that is won within them; more than any network says

/** From gentle to hardest: what it is called, what that means, how late it sees [s], whether it is told. */
export const DIFFICULTIES = {
  gentle: { words: "gentle: sees where you were a second ago", late: 1 },
  fair: { words: "fair: sees where you were half a second ago", late: 0.5 },
  sharp: { words: "sharp: sees you at once", late: 0 },
  told: { words: "knows you: sees which keys you hold", late: 0, isTold: true },
};

/**
 * A player as good as a difficulty says.
 *
 * @param player from (game, state, role) to actions in the order it prefers them
 * @param difficulty a name in `DIFFICULTIES`
 * @param worth what a state is worth to it, if it knows: from (game, state, role) to a number
 * @returns from (game, state, role, states, told) to actions; `states` are all of the game, `told` is the other's action
 */
export function asHardAs(player, difficulty, worth = null) {
  const { late, isTold } = DIFFICULTIES[difficulty];
  if (isTold) return foreseeing(player, worth);
  return late ? seeingLate(player, late) : player;
}

/** Sees the other robot where it was some seconds ago. */
function seeingLate(player, seconds) {
  return (game, state, role, states) => {
    const rival = other(role);
    const before = states[Math.max(0, states.length - 1 - Math.round(seconds / game.dt))];
    return player(game, { ...state, [rival]: before[rival] }, role);
  };
}

/** Tries its best actions against the one that the other takes, and prefers those that lead to more. */
function foreseeing(player, worth) {
  return (game, state, role, states, told) => {
    const actions = player(game, state, role);
    const value = (action) => afterHolding(game, state, role, { [role]: action, [other(role)]: told }, worth);
    const tried = actions.slice(0, TRIED).map((action) => ({ action, value: value(action) }));
    const best = tried.toSorted((one, two) => two.value - one.value).map(({ action }) => action);
    return [...best, ...actions.slice(TRIED)];
  };
}

/** What a state is worth after both have held their actions; without a `worth`, only who has won by then counts. */
function afterHolding(game, state, role, actions, worth) {
  for (let held = 0; held < HELD; held++) {
    const after = step(game, state, actions);
    if (after.outcome !== "ongoing") {
      const won = winner(game, after.outcome);
      return won === null ? 0 : won === role ? DECIDED - held : held - DECIDED;
    }
    state = after.state;
  }
  return worth ? worth(game, state, role) : 0;
}
