// What a person has reached, kept in this browser alone: what is won, and the best time at it. Lost where nothing is kept.

import { PURSUER } from "./rules.js";

const KEY = "apollonius.best";

function read() {
  try {
    const kept = JSON.parse(localStorage.getItem(KEY) ?? "{}");
    return kept !== null && typeof kept === "object" ? kept : {};
  } catch {
    return {};
  }
}

/** What is kept of a challenge, by its name: {isWon, seconds}, or null. */
export function bestOf(name) {
  const found = Object.hasOwn(read(), name) ? read()[name] : null;
  return found && Number.isFinite(found.seconds) ? { isWon: found.isWon === true, seconds: found.seconds } : null;
}

/** Whether one result is better than another: won before not won; then by time, for a hunter the shorter one. */
function isBetter(result, before, wantsShort) {
  if (before === null || result.isWon !== before.isWon) return before === null || result.isWon;
  return result.isWon && wantsShort ? result.seconds < before.seconds : result.seconds > before.seconds;
}

/** What a choice is called as a challenge: its level, or the players, the arena and how hard. */
export const challengeOf = ({ level, pursuer, evader, game, difficulty }) =>
  level?.key ?? [pursuer, evader, game, difficulty].join(" ");

/** Keep how a match has ended for the person who played a side if it is the best so far; returns whether it is. */
export function keepBest(name, match, side) {
  const result = { isWon: match.winner === side, seconds: Number(match.seconds.toFixed(1)) };
  if (!isBetter(result, bestOf(name), side === PURSUER)) return false;
  try {
    localStorage.setItem(KEY, JSON.stringify({ ...read(), [name]: result }));
  } catch {
    // A browser that keeps nothing: the game is the same.
  }
  return true;
}
