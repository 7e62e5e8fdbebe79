// What is said to a person: names of players in words, the goal, how a game ended. Replays and addresses keep the names.

import { EVADER, PURSUER, ROLES, other } from "./game.js";

export const YOU = "you";
export const SHIELDED = "shielded:";

const WORDS = {
  [YOU]: "you",
  pursuer: "trained in many arenas",
  evader: "trained in many arenas",
  optimal: "taught by the solved game",
  smooth: "drives smoothly",
  curriculum: "learned step by step",
  scratch: "learned from nothing",
  stage1: "has only caught robots at rest",
  random: "moves at random",
  still: "stands still",
  "pure-pursuit": "drives at the other",
  intercept: "intercepts the other",
  "voronoi-pursuit": "shrinks the other's free space",
  encirclement: "surrounds the other",
  flee: "drives straight away",
  "flee-aware": "flees to open space",
  territory: "plays for the territory",
};

/** Without what is put before a name. */
export const bare = (name) => name.replace(SHIELDED, "");

/** A player in words: "knows any arena"; its name where there are none. */
export function inWords(name) {
  const known = bare(name);
  const [, share] = /^learner-(\d+)$/.exec(known) ?? [];
  if (share) return share === "0" ? "has learned nothing yet" : `after ${share} % of its training`;
  return known === "P_random" ? "learned against random moves" : (WORDS[known.replace(/^[PE]_/, "")] ?? known);
}

/** Return the name of a side in words. */
export const wordsOf = (players) => [...new Set(players.map(({ words }) => words))].join("; mates: ");

const COLOUR = { [PURSUER]: "red", [EVADER]: "blue" };
export const asTime = (seconds) => `${seconds.toFixed(1)}\u00a0s`;

/** Return the goal of a match. `me` is the side of the one person who plays, or null; who plays an endless level has no limit. */
export function describeGoal({ game, players, start, challenge }, me, isEndless = false) {
  if (challenge?.seconds === null) return "A line that wins. Then it is your turn";
  if (challenge) return `Somebody ${challenge.me === EVADER ? "fled" : "hunted"} for ${asTime(challenge.seconds)}. Then it is your turn`;
  if (!me) {
    const [red, blue] = ROLES.map((role) => wordsOf(players[role]));
    return red === blue ? "Red hunts, blue flees" : `Red: ${red}. Blue: ${blue}`;
  }
  const limit = `${Number((game.max_steps * game.dt).toFixed(1))}\u00a0s`;
  const [ours, theirs] = [start[me].length, start[other(me)].length];
  const hidden = game.sensors ? " (walls hide you both)" : "";
  const you = `You are ${COLOUR[me]}${ours > 1 ? ` 1 of ${ours}` : ""}${hidden}`;
  if (me === EVADER && game.arena.territory) return `${you}: reach the ring within ${limit}`;
  const long = isEndless ? "as long as you can" : `${theirs > 1 ? "for " : ""}${limit}`;
  if (me === EVADER) return `${you}: survive ${theirs > 1 ? `${theirs} reds ` : ""}${long}`;
  const blue = { 1: "blue", 2: "both blues" }[theirs] ?? `all ${theirs} blues`;
  return game.arena.territory ? `${you}: keep ${blue} from the ring for ${limit}` : `${you}: catch ${blue} within ${limit}`;
}

/** Return how a game ended, and who has won, from the view of a person on one side, if there is one. */
export function describeEnd({ game, outcome, start, seconds, winner }, me, isEndless = false) {
  const own = start[me]?.length > 1 ? "your team" : "you";
  const [red, blue] = ROLES.map((role) => (role === me ? own : COLOUR[role]));
  const isMine = outcome === "no_result" && me === EVADER && !game.arena.territory;
  const [role, what] = outcome.startsWith(PURSUER) ? [red, outcome.slice(PURSUER.length + 1)] : [blue, outcome.replace("evader_", "")];
  const happened = {
    captured: `${red} caught ${blue}`,
    hit_obstacle: `${role} hit an obstacle`,
    out_of_range: `${role} ran into a wall`,
    both_failed: "both crashed at once",
    territory_reached: `${blue} reached the ring`,
    no_result: isMine ? `${own} survived` : "time is up",
  }[what];
  const said = `${happened[0].toUpperCase()}${happened.slice(1)} ${isMine ? "for" : "after"} ${asTime(seconds)}`;
  if (winner === null) return `${said}: nobody wins.`;
  if (!me) return `${said}: ${COLOUR[winner]} wins.`;
  return winner === me ? `${said}. You win!` : `${said}.${isEndless ? "" : " You lose."}`;
}

/** Return until when a person who crashed could have braked, by the number of a state; empty where that is unknown. */
export const describeBrake = ({ game }, number) => (number === null ? "" : `Until ${asTime(number * game.dt)} you could have braked in time.`);

/** Return until when the agent in a person's place would have done better, by the number of a state; null for never. */
export function describeChance({ game }, me, number) {
  const better = me === EVADER ? "have got away" : "have won";
  return number === null ? `An agent in your place would not ${better} either.` : `At ${asTime(number * game.dt)} an agent in your place would still ${better}.`;
}

const SHIELDS = {
  [Infinity]: "Your shield brakes for you.",
  2: "Your shield brakes for you twice; after that brake yourself: ↓.",
};

/**
 * Return what a game is about and how it is started and steered: first the line that a person reads first.
 *
 * @param people how many play; `me` is the side of the one person who does, or null
 * @param isFoggy whether walls hide the opponent
 * @param isBusy whether people or other things move in the arena
 * @param shields how often a shield brakes for the person
 * @param level that is played, or null; a scenario has a task
 */
export function describeReady({ people, me, isFoggy, isBusy, shields, level }) {
  const touch = matchMedia("(pointer: coarse)").matches;
  const first = level?.task ? level.name : { [EVADER]: "Red is hunting you.", [PURSUER]: "Blue flees: cut it off." }[me];
  const task = level?.task ? `${level.task} It plays at half speed.\n` : "";
  const both = touch ? "red has the left pad, blue the right one" : "red steers by W A S D, blue by the arrow keys";
  const alone = touch ? "hold the pad to steer" : "↑ speeds up, ↓ brakes, ← → turn";
  const how = { 0: "agents play", 1: alone, 2: both }[people];
  const begin = `${task}${touch || self !== top ? "Start" : "Space"} to begin; ${how}.`;
  const fog = isFoggy ? "Hatched is where the other may be." : "";
  const busy = isBusy ? "Touch no one: only who stands still may be walked into." : "";
  return [first, [begin, SHIELDS[shields], fog, busy].filter(Boolean).join(" ")].filter(Boolean).join("\n");
}
