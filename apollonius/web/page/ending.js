// Sentences for a person: the side, the goal, and how a game ended.

import { EVADER, PURSUER, ROLES, isActive, other } from "./game.js";
import { STAND_IN } from "./hindsight.js";
import { levelWonBy } from "./levels.js";
import { wordsOf } from "./match.js";

const COLOUR = { [PURSUER]: "red", [EVADER]: "blue" };
const SIDE = { [PURSUER]: "Red", [EVADER]: "Blue" };
const FATES = { hit_obstacle: "hit an obstacle", out_of_range: "ran into a wall", hit_mate: "hit a team mate" };

const limit = ({ game }) => `${Number((game.max_steps * game.dt).toFixed(1))}\u00a0s`;
const after = (steps, { game }) => `after ${(steps * game.dt).toFixed(1)}\u00a0s`;

/** Return the goal of a match. `me` is the side of the one person who plays, or null. */
export function describeGoal(match, me) {
  const { game, players, start } = match;
  if (!me) {
    const [red, blue] = ROLES.map((role) => wordsOf(players[role]));
    return red === blue ? "Red hunts, blue flees" : `Red ${red}; blue ${blue}`;
  }
  const [ours, theirs] = [start[me].length, start[other(me)].length];
  const you = `You are ${COLOUR[me]}${ours > 1 ? ` 1 of ${ours}` : ""}`;
  if (me === EVADER && game.arena.territory) return `${you}: reach the ring within ${limit(match)}`;
  if (me === EVADER) return `${you}: survive ${theirs > 1 ? `${theirs} reds for ` : ""}${limit(match)}`;
  const blue = { 1: "blue", 2: "both blues" }[theirs] ?? `all ${theirs} blues`;
  return game.arena.territory ? `${you}: keep ${blue} from the ring for ${limit(match)}` : `${you}: catch ${blue} within ${limit(match)}`;
}

/** Return why a robot is out of play. */
function befell(who, status) {
  return `${who} ${status === "captured" ? `${who === "You" ? "were" : "was"} caught` : FATES[status]}`;
}

/** Return how a game ended, from the view of a person on one side, if there is one. */
function describeOutcome({ outcome, start }, me) {
  const hasMates = (role) => start[role].length > 1;
  const side = (role) => (role !== me ? SIDE[role] : hasMates(role) ? "Your team" : "You");
  const last = (role) => (!hasMates(role) ? side(role) : role === me ? "The last of your team" : `The last ${COLOUR[role]}`);
  const it = me && !hasMates(EVADER) ? "it" : "blue";
  if (outcome === "both_failed") return me && !hasMates(me) ? "You both crashed at once" : "Both crashed at once";
  if (outcome === "territory_reached") return `${side(EVADER)} reached the ring`;
  if (outcome === "no_result") return me === EVADER ? `${side(EVADER)} survived` : `Time is up, ${it} got away`;
  if (outcome === "captured" && me !== EVADER) return `${side(PURSUER)} caught ${it}`;
  if (outcome === "captured") return befell(last(EVADER), outcome);
  const [role] = outcome.split("_", 1);
  return befell(last(role), outcome.slice(role.length + 1));
}

/** Return what happened to a person's robot before its team's game was over, or with its last robot. */
function describeOwn(match, me) {
  const { states } = match;
  const out = states.findIndex((state) => !isActive(state[me][0]));
  if (states[0][me].length === 1 || out < 0) return null;
  const own = befell("You", states[out][me][0].status);
  const isLast = out === states.length - 1 && !states[out][me].some(isActive);
  return { isLast, what: isLast ? `${own}, the last of your team,` : `${own} ${after(out, match)}` };
}

/** Return the message while a person's team plays on without its first robot, empty while it is in play. */
export function describeLost(match, me) {
  const own = me && describeOwn(match, me);
  return own ? `${own.what}. Your team plays on.` : "";
}

/** Return how a game ended, and who has won. */
export function describeEnd(match, me) {
  const { winner } = match;
  const [what, own] = [describeOutcome(match, me), me && describeOwn(match, me)];
  const joint = winner === me ? "but" : "and";
  const told = own?.isLast ? own.what : own ? `${own.what}, ${joint} ${what[0].toLowerCase()}${what.slice(1)}` : what;
  const said = `${told} ${after(match.state.steps, match)}`;
  if (winner === null) return `${said}: nobody wins.`;
  if (!me) return `${said}: ${COLOUR[winner]} wins.`;
  return winner === me ? `${said}. You win!` : `${said}. You lose.`;
}

/** Return until when a person who crashed could have braked, empty where it is unknown. */
export function describeBrake({ game }, last) {
  return last === null ? "" : `Until ${(last * game.dt).toFixed(1)}\u00a0s you could have braked in time.`;
}

/**
 * Return until when another player in a person's place would have done better; `chance` comes from `lastChance`.
 */
export function describeChance({ game }, me, chance) {
  const better = me === EVADER ? "have got away" : "have won";
  if (chance.number === null) return `The agent ${STAND_IN[me]} would not ${better} either, even ${chance.seconds.toFixed(1)}\u00a0s before.`;
  return `Until ${(chance.number * game.dt).toFixed(1)}\u00a0s the agent ${STAND_IN[me]} would ${better}.`;
}

/** Return how a game is started and steered by a number of people. */
export function describeReady(people) {
  const touch = matchMedia("(pointer: coarse)").matches;
  const how = people ? (touch ? "hold the pad to steer" : "arrow keys to steer") : "agents play";
  return `${touch ? "Start" : "Space"} to begin; ${how}`;
}

/** Return the label of the main button. */
export function describeGo(session) {
  const { phase, match, me } = session;
  if (phase !== "over") return { counting: "Pause", playing: "Pause", paused: "Go on" }[phase] ?? "Start";
  if (levelWonBy(session, me)) return "Next level";
  return me && match.winner !== me ? "Try again" : "Next game";
}
