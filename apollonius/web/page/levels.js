// Levels: challenges over arenas, each harder than the one before, and two of teams. What a person has reached is stored in
// this browser alone.

import { EVADER, PURSUER } from "./game.js";

/** In their order: what it is called, whom a person plays, with and against whom, how hard, where, for how long [s]. */
export const LEVELS = [
  { name: "Open floor", side: EVADER, against: "P_any", difficulty: "gentle", game: "open", seconds: 20 },
  { name: "Three pillars", side: EVADER, against: "P_any", difficulty: "gentle", game: "paper", seconds: 40 },
  { name: "The hunter", side: PURSUER, against: "flee-aware", difficulty: "gentle", game: "paper", seconds: 60 },
  { name: "A courtyard", side: EVADER, against: "P_any", difficulty: "gentle", game: "courtyard", seconds: 60 },
  { name: "Nine houses", side: EVADER, against: "P_any", difficulty: "fair", game: "blocks", seconds: 60 },
  { name: "Hunting in the office", side: PURSUER, against: "flee-aware", difficulty: "fair", game: "office", seconds: 100 },
  { name: "The maze", side: EVADER, against: "P_any", difficulty: "fair", game: "maze", seconds: 60 },
  { name: "Three pillars, sharp", side: EVADER, against: "P_optimal", difficulty: "sharp", game: "paper", seconds: 100 },
  { name: "The warehouse", side: EVADER, against: "P_any", difficulty: "sharp", game: "warehouse", seconds: 100 },
  { name: "It knows you", side: EVADER, against: "P_optimal", difficulty: "told", game: "paper", seconds: 100 },
  { name: "Lead two others", side: PURSUER, mates: "pure-pursuit", against: "E_any", difficulty: "fair", game: "team-3v1", seconds: 60 },
  { name: "Three hunters", side: EVADER, against: "pure-pursuit", difficulty: "gentle", game: "team-3v1", seconds: 30 },
].map((level, index) => ({ ...level, number: index + 1, key: `level ${level.name}` }));

/** The level of a number in an address, or null. */
export const levelOf = (number) => LEVELS[Number(number) - 1] ?? null;

/** The level after the one of a match that `me` has won, or null. */
export function levelWonBy({ choice, match }, me) {
  return me && choice?.level && match?.isOver && match.winner === me ? (LEVELS[choice.level.number] ?? null) : null;
}

/** Return a game with another time limit [s]. */
export const lasting = (game, seconds) => ({ ...game, max_steps: Math.round(seconds / game.dt) });

/** The arenas that only levels have: the paper's without its discs. */
export const withOpenFloor = (games) => {
  const { paper } = games;
  return { ...games, open: { ...paper, arena: { ...paper.arena, discs: [] } } };
};

const KEY = "apollonius.best";

function read() {
  try {
    const kept = JSON.parse(localStorage.getItem(KEY) ?? "{}");
    return kept !== null && typeof kept === "object" ? kept : {};
  } catch {
    return {};
  }
}

/** Return the best result of a challenge: {isWon, seconds}, or null. */
export function bestOf(name) {
  const found = Object.hasOwn(read(), name) ? read()[name] : null;
  return found && Number.isFinite(found.seconds) ? { isWon: found.isWon === true, seconds: found.seconds } : null;
}

/** Return whether one result is better than another: won before not won; then by time, for a pursuer the shorter one. */
function isBetter(result, before, wantsShort) {
  if (before === null || result.isWon !== before.isWon) return before === null || result.isWon;
  return result.isWon && wantsShort ? result.seconds < before.seconds : result.seconds > before.seconds;
}

/** Return the name of a choice as a challenge: its level, or players, arena and difficulty. */
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
