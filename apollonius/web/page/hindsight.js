// A game that is over, looked back at: it ends once more and slowly, from the last moment at which it could have been saved.

import { ACTIONS, EVADER, PURSUER, ROLES, clip, isActive, robotOf } from "./game.js";
import { ANYWHERE, findPlayer } from "./players.js";
import { stoppable } from "./why.js";
import { SHIELDED, bare } from "./words.js";

const LASTS = 3; // of the slow replay, at least [s]
const SLOWER = 2; // times slower than it was
const FASTER = 3; // times faster, in a film
export const IMPACT = 1.1; // for how long a game that is over stands still before it is replayed [s]
const AFTERWARDS = 1.5; // the end of a film, which stands still [s]
const GIVEN = { [PURSUER]: 20, [EVADER]: 10 }; // how long a pursuer has to win, and an evader to stay free [s]
const STRIDE = 0.5; // between moments that are tried [s]
const HOLDS = [1, 2]; // for how long an evader holds each action where it finds no way out by itself [s]
const FARTHEST = 20; // before the end [s]

/** The replay of a game that is over: it plays slowly to the end, or holds a moment. */
export class SlowReplay {
  constructor(match) {
    this.match = match;
    this.last = match.states.length - 1;
  }

  /**
   * Play from a state, by its number, or from a few seconds before the end if that is earlier; `now` is the time [s]. The end
   * stands still before, for a `rest` [s].
   */
  play(number, now, rest = 0) {
    const moments = Math.max(1, Math.round(LASTS / SLOWER / this.match.game.dt));
    Object.assign(this, { first: clip(number, 0, Math.max(0, this.last - moments)), begun: now + rest, rest, held: null, slower: SLOWER });
  }

  /** Play all of it faster than it was; returns how long that takes [s]. */
  film(now) {
    Object.assign(this, { first: 0, begun: now, rest: 0, held: null, slower: 1 / FASTER, isFilmed: true });
    return (this.last * this.match.game.dt) / FASTER + AFTERWARDS;
  }

  /** Hold a moment, by the number of its state: the match as it stood then. */
  hold(number) {
    this.held = this.match.from(number);
  }

  /** For how long the end has been shown at a time [s]: before the replay or after it; null where another moment is shown. */
  sinceEnd(now) {
    if (this.held) return null;
    if (now < this.begun) return this.rest - (this.begun - now);
    const after = now - this.begun - (this.last - this.first) * this.match.game.dt * this.slower;
    return after >= 0 ? after : null;
  }

  /** The number of the state that is shown at a time [s], whole or between two. */
  at(now) {
    if (this.held) return this.held.states.length - 1;
    if (now < this.begun && this.rest) return this.last;
    return Math.min(this.first + Math.max(0, now - this.begun) / this.slower / this.match.game.dt, this.last);
  }
}

/** Return whether a robot is out of play because it touched a wall or an obstacle. */
export const hasCrashed = (state, who) => ["hit_obstacle", "out_of_range"].includes(robotOf(state, who).status);

/** The number of the last state from which a robot, {role, number}, that crashed could still have braked in time, or null. */
export function lastBrake({ game, states }, who) {
  const last = states.findLastIndex((state) => isActive(robotOf(state, who)) && stoppable(game, state, who).includes(true));
  return last < 0 ? null : last;
}

/** Who tries in the place of a person; null where a player acts by chance, as it would then act otherwise. */
export async function standIn(catalogue, match, role) {
  const players = ROLES.flatMap((side) => match.players[side]);
  if (!Object.hasOwn(catalogue.files, ANYWHERE[role]) || players.some(({ name }) => bare(name).startsWith("random"))) return null;
  return findPlayer(catalogue, SHIELDED + ANYWHERE[role], role, "sharp");
}

/**
 * Look for the last state of a match, each half second before its end, from which a stand-in for a robot would have stayed free
 * for ten seconds or, a pursuer, have won: the recorded game is played on by the rules and against the very players of the match.
 * Where an evader fails it tries again, each action for some time first. The search goes on by one step of a game whenever it is
 * asked.
 *
 * @returns the number of the state, or null
 */
export function* lastChance(match, who, stand) {
  const { dt } = match.game;
  const gone = match.states.findIndex((state) => !isActive(robotOf(state, who)));
  const end = gone < 0 ? match.states.length - 1 : gone;
  for (let back = STRIDE; back <= Math.min(FARTHEST, end * dt); back += STRIDE) {
    const number = end - Math.round(back / dt);
    const holding = HOLDS.flatMap((time) => ACTIONS.map((action) => holds(stand, action, number + Math.round(time / dt))));
    for (const player of who.role === EVADER ? [stand, ...holding] : [stand]) if (yield* doesBetter(match, number, who, player)) return number;
  }
  return null;
}

/** A player that holds an action up to a state, by its number. */
const holds = (player, action, until) => ({
  ...player,
  act: (game, state, who, states) => (states.length <= until ? action : player.act(game, state, who, states)),
});

/** Return whether a player does better in a robot's place from a state on. */
function* doesBetter(match, number, who, player) {
  const players = { ...match.players, [who.role]: match.players[who.role].with(who.number, player) };
  const tried = match.from(number, players);
  const last = number + Math.round(GIVEN[who.role] / match.game.dt);
  const isCaught = () => who.role === EVADER && !isActive(robotOf(tried.state, who));
  while (!tried.isOver && !isCaught() && tried.states.length <= last) {
    tried.step();
    yield;
  }
  return !isCaught() && (tried.isOver ? tried.winner === who.role : who.role === EVADER);
}
