// Levels: challenges over arenas, each harder than the one before, then two of teams, one among people, and the scenarios of the
// benchmark. What a person has won is stored in this browser alone.

import { inFog } from "./fog.js";
import { EVADER, PURSUER, fromRow, other } from "./game.js";
import { ANYWHERE } from "./players.js";

/**
 * In their order: what it is called, whom a person plays, against whom, how hard, where, for how long [s]; in the first one
 * the person starts with open floor ahead, and a shield brakes for the robot; opponents have one; in fog nobody
 * sees through walls. A lesson is watched. A start is a row: x, y, v, heading of each pursuer, then of each evader. A scenario
 * has one start only, a task, and for each robot of its side a line of actions that wins, each held for some steps.
 */
export const LEVELS = [
  { name: "Open floor", side: EVADER, against: "pursuer", difficulty: "gentle", game: "open", seconds: 20, shields: Infinity, start: [9.2, 0.8, 0, 1.6, 5.5, 5.5, 0, 2.4] },
  { name: "Three pillars", side: EVADER, against: "pursuer", difficulty: "gentle", game: "paper", seconds: 40, shields: 2, start: [9.4, 5.1, 0, 3.1, 6, 5.5, 0, 3.1] },
  { name: "Watch it learn", side: null, difficulty: "sharp", game: "paper", seconds: 20, isLesson: true },
  { name: "The hunter", side: PURSUER, against: "flee-aware", difficulty: "gentle", game: "paper", seconds: 60, shields: 2, start: [1.5, 5.5, 0, 0, 5.5, 5.5, 0, 1.6] },
  { name: "A courtyard", side: EVADER, against: "pursuer", difficulty: "gentle", game: "courtyard", seconds: 60 },
  { name: "Nine houses", side: EVADER, against: "pursuer", difficulty: "fair", game: "blocks", seconds: 60 },
  { name: "Hunting in the office", side: PURSUER, against: "flee-aware", difficulty: "fair", game: "office", seconds: 100 },
  { name: "The maze", side: EVADER, against: "pursuer", difficulty: "fair", game: "maze", seconds: 60 },
  { name: "Three pillars, sharp", side: EVADER, against: "pursuer", difficulty: "sharp", game: "paper", seconds: 100 },
  { name: "The warehouse", side: EVADER, against: "pursuer", difficulty: "sharp", game: "warehouse", seconds: 100 },
  { name: "In the fog", side: EVADER, against: "pursuer", difficulty: "sharp", game: "blocks", seconds: 60, isFoggy: true },
  { name: "Hide and seek", side: PURSUER, against: "flee-aware", difficulty: "sharp", game: "office", seconds: 100, isFoggy: true },
  { name: "Lead two others", side: PURSUER, against: "evader", difficulty: "fair", game: "team-3v1", seconds: 60 },
  { name: "Three hunters", side: EVADER, against: "pure-pursuit", difficulty: "gentle", game: "team-3v1", seconds: 30 },
  { name: "Rush hour", side: EVADER, against: "pursuer", difficulty: "fair", game: "rush-hour", seconds: 60, shields: 2, seed: 6 },
].map((level, index) => ({ seed: index + 1, ...level, number: index + 1 }));

/** Append the scenarios of a catalogue to the levels, and their games to its games. */
export function addScenarios({ scenarios, games }) {
  for (const { name, rules, ...scenario } of scenarios) {
    const words = name.replaceAll("_", " ");
    const level = { ...scenario, name: words[0].toUpperCase() + words.slice(1), game: name, against: ANYWHERE[other(scenario.side)] };
    games[name] = rules;
    LEVELS.push({ ...level, difficulty: "sharp", seed: 0, number: LEVELS.length + 1 });
  }
}

const ENDLESS = 600; // [s]

/** The level after the one that the person of a session has won or watched, or null. */
export function levelWonBy({ choice, match, me, lesson }) {
  if (lesson) return LEVELS[lesson.level.number];
  return me && choice?.level && match?.isOver && match.winner === me ? (LEVELS[choice.level.number] ?? null) : null;
}

/** Return whether a level has an endless version. */
export const canBeEndless = ({ side, task }) => side === EVADER && !task;

/** Return a level of an evader in which it plays for as long as it lasts, and not only up to a limit. */
export const endless = (level) => ({ ...level, name: `${level.name}, endless`, seconds: ENDLESS, isEndless: true });

const RADIUS = 0.15; // of robots at least, so that what is seen to touch a wall does [m]

/** Return the start of a level of a game, or null where it is drawn. */
export const startOf = (game, { start }) => (start ? fromRow(game, start, 0, () => "active") : null);

/** Return a game with the time limit of a level, its fog, and robots that are as large as they look; a scenario's as it is. */
export function ofLevel(game, { seconds, isFoggy, task }) {
  if (task) return game;
  const wide = (body) => ({ ...body, radius: Math.max(body.radius, RADIUS) });
  const { pursuers = [], evaders = [] } = game.teams ?? {};
  const teams = game.teams && { ...game.teams, pursuers: pursuers.map(wide), evaders: evaders.map(wide) };
  const bodies = { pursuer: wide(game.pursuer), evader: wide(game.evader) };
  const lasting = { ...game, ...bodies, ...(teams && { teams }), max_steps: Math.round(seconds / game.dt) };
  return isFoggy ? inFog(lasting) : lasting;
}

/** Return a game without its discs, which only levels have. */
export const withOpenFloor = (game) => ({ ...game, arena: { ...game.arena, discs: [] } });

const DOOR = { radius: 0.05, period: 20, share_open: 0.5, v_max: 0.5, a_max: 0.5 };
const RUSH = {
  shuttles: [],
  doors: [{ x: 2.7, y: 6.1, hx: -0.7, hy: 0, ...DOOR }, { x: 13.7, y: 6.1, hx: 0.7, hy: 0, ...DOOR }],
  walkers: [{ count: 8, radius: 0.25, v_max: 0.8, a_max: 2 }],
};

/** Return the game of the office with people, and doors to the rooms in its upper corners. */
export const inRushHour = (office) => ({ ...office, movers: RUSH });

const KEY = "apollonius.best";

function read() {
  try {
    return Object(JSON.parse(localStorage.getItem(KEY)));
  } catch {
    return {};
  }
}

/** Return the time [s] of the fastest win of a level, of an endless one the longest game, or null. */
export function bestOf({ name }) {
  const seconds = read()[name];
  return Number.isFinite(seconds) ? seconds : null;
}

/** Keep the time of a game if it is the best of a level; returns whether it is. */
export function keepBest(level, seconds) {
  const best = bestOf(level);
  if (best !== null && (level.isEndless ? seconds <= best : seconds >= best)) return false;
  try {
    localStorage.setItem(KEY, JSON.stringify({ ...read(), [level.name]: seconds }));
  } catch {
    // A browser that keeps nothing: the game is the same.
  }
  return true;
}
