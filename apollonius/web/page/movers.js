// Things that move by themselves, shuttles, doors and walkers: in the programs' memory, in game files, and in replays.
//
// A state has `movers` where its game has some: the leaves of the package's `MoverStates`, arrays with room for `MOST_MOVERS` of each
// kind. Those that a game does not have are far away.

import { MOST_MOVERS, moversOf } from "./game.js";
import { given } from "./programs.js";

const FAR = 1e5; // [m]
const LIMITS = { radius: 1, v_max: 1, a_max: 1 };
/** What takes the places of movers that a game does not have, by kind. */
const NOBODY = {
  shuttles: { waypoints: [[FAR, FAR], [FAR + 1, FAR]], hx: 0, hy: 0, pause: 0, count: 2, ...LIMITS },
  doors: { x: FAR, y: FAR, hx: 1, hy: 0, period: 100, share_open: 0.5, ...LIMITS },
  walkers: LIMITS,
};
const KINDS = Object.keys(NOBODY);
const TIMED = MOST_MOVERS.shuttles + MOST_MOVERS.doors; // which come before walkers
let written = false; // the movers whose limits were written last

/** Write the movers of a game, and those of a state where it has some. */
export function writeMovers(game, state) {
  const into = given.movers();
  if (written !== game.movers) {
    written = game.movers;
    const all = moversOf(game);
    for (const kind of KINDS) {
      const own = all.filter((mover) => mover.kind === kind);
      for (let index = 0; index < MOST_MOVERS[kind]; index++) {
        for (const [key, value] of Object.entries(own[index] ?? NOBODY[kind])) into[`${kind}_${index}_${key}`]?.set([value].flat(2));
      }
    }
    into.count[0] = all.length;
    into.walking[0] = all.filter(({ kind }) => kind === "walkers").length;
  }
  if (state.movers) for (const [key, values] of Object.entries(given.mover_states())) values.set(state.movers[key]);
}

/** Write what was drawn for a start: x and y of several places of each walker. */
export function writeDraws(places, random) {
  given.clock_shares().set(Array.from(given.clock_shares(), random));
  given.bits().set(Array.from(given.bits(), () => Math.floor(2 ** 32 * random())));
  Object.values(given.walker_places()).forEach((values, axis) => values.fill(FAR).set(places.flat().map((place) => place[axis])));
}

/** How many places are drawn for each walker. */
export const TRIES = given.clock_shares().length / TIMED;

/** The places of a game's movers in an array of all, or of all by the clock, or of all walkers. */
function placesIn(values, game) {
  const first = values.length === MOST_MOVERS.walkers ? TIMED : 0;
  return moversOf(game).map(({ place }) => place - first).filter((place) => place >= 0 && place < values.length);
}

/** The movers of a state as replays have them: lists of the numbers of those that the game has. */
export const asLists = (game, movers) => Object.values(movers).map((values) => placesIn(values, game).map((place) => values[place]));

/** The movers of such lists. Throws an Error where they are not those of a game. */
export function fromLists(game, lists) {
  const made = Object.entries(given.mover_states()).map(([key, like], leaf) => {
    const values = like.slice().fill(/_[xy]$/.test(key) ? FAR : 0);
    const places = placesIn(values, game);
    if (lists[leaf]?.length !== places.length || !lists[leaf].every(Number.isFinite)) throw new Error("other movers");
    places.forEach((place, index) => (values[place] = lists[leaf][index]));
    return [key, values];
  });
  return Object.fromEntries(made);
}
