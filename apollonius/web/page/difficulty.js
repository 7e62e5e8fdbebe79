// How hard an opponent is, in words. The robots are always the same: an easier opponent sees late, the hardest one sees
// what the other is about to do. Neither changes how a player sees its own robot, so that a shield stays a shield.

import { HOLD, other, step, winner } from "./rules.js";

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

/** What a state is worth after all have held their actions; without a `worth`, only who has won by then counts. */
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
