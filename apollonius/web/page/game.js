// What a game consists of: sides, robots, actions, outcomes, as in the package.
//
// A robot is {x [m], y [m], v [m/s], heading [rad, in (-pi, pi]], status}; a state is {pursuer, evader, steps}, a list of
// robots for either side; a game is what `apollonius.arenas.file.to_dict` writes, a map with its field (`files.js`).
// {role, number} names a robot of a game: its side, and its place there.

export const PURSUER = "pursuer";
export const EVADER = "evader";
export const ROLES = [PURSUER, EVADER];
export const HOLD = 4; // the action that keeps the speed and goes straight
export const ACTIONS = [0, 1, 2, 3, 4, 5, 6, 7, 8];
export const STATUSES = ["active", "captured", "hit_obstacle", "out_of_range"];
export const OUTCOMES = [
  "ongoing",
  "captured",
  "pursuer_hit_obstacle",
  "evader_hit_obstacle",
  "pursuer_out_of_range",
  "evader_out_of_range",
  "both_failed",
  "no_result",
  "territory_reached",
];

/** The most movers of each kind, in the order of the rules. */
export const MOST_MOVERS = { shuttles: 4, doors: 6, walkers: 12 };

export const clip = (value, low, high) => Math.min(Math.max(value, low), high);

export const other = (role) => (role === PURSUER ? EVADER : PURSUER);

/** Return {pursuer, evader}: what a function makes of either role and its number. */
export const bySide = (make) => ({ pursuer: make(PURSUER, 0), evader: make(EVADER, 1) });

/** Return the same direction in (-pi, pi] [rad]. */
export const wrapAngle = (angle) => angle - 2 * Math.PI * Math.ceil((angle - Math.PI) / (2 * Math.PI));

/** Return whether an action is a pair of levels, and not one of the discrete ones 0..8. */
export const isContinuous = (action) => Array.isArray(action);

/** Return an action's levels, shares of u1_max and u2_max: of a discrete one -1, 0 or 1 each; others are clipped. */
export function actionLevels(action) {
  if (isContinuous(action)) return action.map((share) => clip(share, -1, 1));
  return [Math.floor(action / 3) - 1, (action % 3) - 1];
}

// ---- robots

/** Return the limits of every robot of a side. */
export const bodiesOf = (game, role) => [game[role], ...(game.teams?.[`${role}s`] ?? [])];

/** Return the limits of one robot. */
export const bodyOf = (game, { role, number }) => bodiesOf(game, role)[number];

/** Return one robot of a state. */
export const robotOf = (state, { role, number }) => state[role][number];

/** Return whether a robot is in play. */
export const isActive = ({ status }) => status === "active";

/** Return the robots of some sides, {role, number}, in the order of their numbers. */
export const robotsOf = (state, roles) => roles.flatMap((role) => state[role].map((_, number) => ({ role, number })));

/** Return the numbers of robots: [3, 1]. */
export const countsOf = (game) => ROLES.map((role) => bodiesOf(game, role).length);

/** Return a state as a row of a replay: x, y, v, heading of each pursuer, then of each evader. */
export const asRow = ({ pursuer, evader }) => [...pursuer, ...evader].flatMap(({ x, y, v, heading }) => [x, y, v, heading]);

/** Return the state of such a row, with the status of each robot by its place in it. */
export function fromRow(game, row, steps, statusOf) {
  const robot = (place) => {
    const [x, y, v, heading] = row.slice(4 * place);
    return { x, y, v, heading, status: statusOf(place) };
  };
  const [pursuers] = countsOf(game);
  return { ...bySide((role, side) => bodiesOf(game, role).map((_, number) => robot(side * pursuers + number))), steps };
}

// ---- games of teams

/** Return a game of two as one of teams, all robots of a side with the limits of its one robot. */
export function inTeams(game, pursuers, evaders) {
  if (pursuers === 1 && evaders === 1) return game;
  const more = (body, count) => Array.from({ length: count - 1 }, () => body);
  const teams = { pursuers: more(game.pursuer, pursuers), evaders: more(game.evader, evaders), mates_collide: false };
  return { ...game, teams };
}

/** Return the name of a game of teams: `team-3v1/office`, and `team-3v1` in the paper's arena. */
export function teamName(arena, [pursuers, evaders]) {
  const team = `team-${pursuers}v${evaders}`;
  if (pursuers === 1 && evaders === 1) return arena;
  return arena === "paper" ? team : `${team}/${arena}`;
}

/** Return the arena and the numbers of robots, [3, 1], in such a name; for a name in `games` the numbers are null. */
export function partsOf(name, games) {
  if (Object.hasOwn(games, name)) return [name, null];
  const [, pursuers, evaders, arena = "paper"] = /^team-(\d{1,2})v(\d{1,2})(?:\/(.+))?$/.exec(name) ?? [];
  return pursuers ? [arena, [Number(pursuers), Number(evaders)]] : [name, null];
}

/** The movers of a game in the order of the rules, each with its `kind` and its `place` in arrays of all; a group is several. */
export function moversOf({ movers }) {
  const kinds = Object.keys(MOST_MOVERS);
  return kinds.flatMap((kind, number) => {
    const all = (movers?.[kind] ?? []).flatMap((mover) => Array(mover.count ?? 1).fill(mover));
    const first = kinds.slice(0, number).reduce((sum, before) => sum + MOST_MOVERS[before], 0);
    return all.map((mover, index) => ({ hx: 0, hy: 0, ...mover, count: mover.waypoints?.length, kind, place: first + index }));
  });
}
