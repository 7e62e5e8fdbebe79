// Levels: challenges over arenas, each harder than the one before, and two of teams. The first explains itself.

import { EVADER, PURSUER } from "./rules.js";

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

/** A game that lasts so many seconds. */
export const lasting = (game, seconds) => ({ ...game, max_steps: Math.round(seconds / game.dt) });

/** The arenas that only levels have: the paper's without its discs. */
export const withOpenFloor = (games) => {
  const { paper } = games;
  return { ...games, open: { ...paper, arena: { ...paper.arena, discs: [] } } };
};
