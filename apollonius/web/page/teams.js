// Games of more robots than two: who they are besides the first of either side, and which robot is the nearest, as in
// `apollonius/game/teams.py`. A robot of a game is told by {role, number}: its side, and which of its robots it is.

/** The limits of every robot of a side. */
export const bodiesOf = (game, role) => [game[role], ...(game.teams?.[`${role}s`] ?? [])];

/** The limits of one robot. */
export const bodyOf = (game, { role, number }) => (number ? game.teams[`${role}s`][number - 1] : game[role]);

/** Where one robot is in a state. */
export const robotOf = (state, { role, number }) => state[role][number];

/** Whether a robot is in play. */
export const isActive = ({ status }) => status === "active";

/** The robots of some sides, {role, number}, in the order of their numbers. */
export const robotsOf = (state, roles) => roles.flatMap((role) => state[role].map((_, number) => ({ role, number })));

/** How many robots either side has: [3, 1]. */
export const countsOf = (game) => ["pursuer", "evader"].map((role) => bodiesOf(game, role).length);

/** A game of two with so many robots on either side, all of a side with the limits of its one robot. */
export function inTeams(game, pursuers, evaders) {
  if (pursuers === 1 && evaders === 1) return game;
  const more = (body, count) => Array.from({ length: count - 1 }, () => body);
  const teams = { pursuers: more(game.pursuer, pursuers), evaders: more(game.evader, evaders), mates_collide: false };
  const record = game.record && { ...game.record, teams };
  return record ? { ...game, teams, record } : { ...game, teams };
}

/** What a game is called that is played by teams: `team-3v1/office`, and `team-3v1` in the paper's arena. */
export function teamName(arena, [pursuers, evaders]) {
  const team = `team-${pursuers}v${evaders}`;
  if (pursuers === 1 && evaders === 1) return arena;
  return arena === "paper" ? team : `${team}/${arena}`;
}

/** The arena and the numbers of robots, [3, 1], in such a name; null is in their place in that of one of the `games`. */
export function partsOf(name, games) {
  if (Object.hasOwn(games, name)) return [name, null];
  const [, pursuers, evaders, arena = "paper"] = /^team-(\d{1,2})v(\d{1,2})(?:\/(.+))?$/.exec(name) ?? [];
  return pursuers ? [arena, [Number(pursuers), Number(evaders)]] : [name, null];
}

/** The opponent of a robot that is nearest of those in play; the first one where none is. */
export function opponentOf(state, { role, number }) {
  const { x, y } = state[role][number];
  const opponents = state[role === "pursuer" ? "evader" : "pursuer"];
  const away = (robot) => (robot.x - x) ** 2 + (robot.y - y) ** 2;
  const [nearest = opponents[0]] = opponents.filter(isActive).toSorted((one, two) => away(one) - away(two));
  return nearest;
}
