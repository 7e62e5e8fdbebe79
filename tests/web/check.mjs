// Answers questions about the page's modules: a JSON object on standard input, another on standard output.
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const { page, ...asked } = JSON.parse(readFileSync(0, "utf8"));
const load = (name) => import(pathToFileURL(`${page}/${name}.js`));
const [game, calls, players, { Match }, hindsight, file, plan, { survey }, fog, share, levels, starts, { Guard }, moving] = await Promise.all(
  ["game", "calls", "players", "match", "hindsight", "gamefile", "plan", "survey", "fog", "share", "levels", "starts", "guard", "movers"].map(load),
);

/** What all robots have in a row, as either side has it. */
const bySide = (rules, all) => {
  const [pursuers] = game.countsOf(rules);
  return { pursuer: all.slice(0, pursuers), evader: all.slice(pursuers) };
};
const asRow = ({ pursuer, evader }) => [...pursuer, ...evader].flatMap(({ x, y, v, heading }) => [x, y, v, heading]);
const asState = (rules, row, statuses = []) => {
  const robots = Array.from({ length: row.length / 4 }, (_, index) => {
    const [x, y, v, heading] = row.slice(4 * index);
    return { x, y, v, heading, status: statuses[index] ?? "active" };
  });
  return { ...bySide(rules, robots), steps: 0 };
};
/** The state of a row with movers, if there are some, by their lists. */
const withMovers = (rules, state, lists) => (lists ? { ...state, movers: moving.fromLists(rules, lists) } : state);

function read(path) {
  const bytes = readFileSync(path);
  return players.readAgent(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength));
}

/** A player of a match by {name, late [s]}: `forwards`, a rule, or the path of an agent's file; `shielded:` may stand before it. */
function findPlayer({ name, late = 0 }, role) {
  const known = name.replace("shielded:", "");
  if (known === "forwards") return { name, act: () => game.HOLD };
  const rule = calls.CLASSICAL[role][known];
  const player = players.BUILT_IN[known] ?? (rule ? players.byValues(rule) : players.trained(read(known)).player);
  const seeing = late ? players.seeingLate(player, late) : player;
  const ranked = name === known ? seeing : players.shielded(seeing);
  return { name, act: (...seen) => ranked(...seen)[0] };
}

const matchOf = ({ game: rules, seed, ...sides }) => {
  const counts = game.countsOf(rules);
  const found = game.ROLES.map((role, side) => [role, Array(counts[side]).fill(findPlayer(sides[role], role))]);
  return new Match(rules, Object.fromEntries(found), seed);
};

/** What a beginner wants to do, by name: from a robot and its rival to an action. */
const towards = (away) => (robot, rival) => {
  const wanted = Math.atan2(rival.y - robot.y, rival.x - robot.x) + (away ? Math.PI : 0);
  const turn = game.wrapAngle(wanted - robot.heading);
  return game.HOLD + 3 + (Math.abs(turn) < 0.1 ? 0 : Math.sign(turn));
};
const BOTS = { flees: towards(true), chases: towards(false), stands: () => game.HOLD };

/** Who plays a level: a beginner behind the level's guard, or a player with a shield. */
function ofBot({ side, shields }, bot) {
  if (!BOTS[bot]) return findPlayer({ name: `shielded:${bot}` }, side);
  const guard = new Guard(shields);
  const wants = (state) => BOTS[bot](state[side][0], state[game.other(side)][0]);
  return { name: bot, act: (rules, state, ...rest) => guard.action(wants(state), rules, state, ...rest) };
}

/** What comes of a question, or the complaint. */
const tried = (work) => work.then((answer) => ({ answer }), ({ message }) => ({ complaint: message }));

const answers = {
  /** States, outcomes and statuses of a game by its actions. */
  games: (all) => all.map(({ game: rules, states, actions, movers }) => {
    let state = withMovers(rules, asState(rules, states[0]), movers);
    const places = () => (movers ? moving.asLists(rules, state.movers).slice(0, 2) : []);
    const [rows, outcomes, statuses, moved] = [[asRow(state)], [], [], [places()]];
    for (const taken of actions) {
      const after = calls.step(rules, state, bySide(rules, taken));
      state = after.state;
      rows.push(asRow(state));
      moved.push(places());
      outcomes.push(after.outcome);
      statuses.push([...state.pursuer, ...state.evader].map(({ status }) => status));
    }
    return { rows, outcomes, statuses, moved };
  }),
  /** What players do: actions, or pairs of levels. */
  plays: (all) => all.map(({ name, game: rules, role, rows, statuses, movers }) => {
    const { act } = findPlayer({ name }, role);
    const actions = rows.map((row, index) => {
      const state = withMovers(rules, asState(rules, row, statuses[index]), movers?.[index]);
      return act(rules, state, { role, number: 0 });
    });
    return actions.some(game.isContinuous) ? actions.map(game.actionLevels) : actions;
  }),
  views({ game: rules, role, number, statuses, rows, observations }) {
    const seen = rows.map((row, index) => [rules, asState(rules, row, statuses[index]), { role, number }]);
    const each = (pairs) => Object.fromEntries(pairs.map(([name, ask]) => [name, seen.map((one) => ask(...one))]));
    const fitting = Object.entries(calls.CLASSICAL[role]).filter(([name]) => calls.fits(name, rules, game.countsOf(rules)[0]));
    const room = ([, state, who]) => game.ACTIONS.map((action) => calls.clearanceAfter(rules, state, who, action));
    return { seen: each(observations.map((name) => [name, (...one) => calls.observe(name, ...one)])), values: each(fitting), clearances: seen.map(room) };
  },
  /** In fog, after each state of a game: the age of either side's last sighting, and the cells where the other side can be. */
  knowledge({ game: rules, rows }) {
    const states = rows.map((row) => asState(rules, row));
    const cells = ({ budget }) => [...budget.keys()].filter((cell) => budget[cell] >= 0);
    const known = (role) => (_, index) => fog.knowledge(fog.inFog(rules), states.slice(0, index + 1), role);
    const told = (found) => ({ age: found.age, last: [found.last.x, found.last.y], cells: cells(found) });
    return Object.fromEntries(game.ROLES.map((role) => [role, states.map(known(role)).map(told)]));
  },
  /** Where a pursuer in fog takes its opponent to be in each of some states of a game: x, y and speed. */
  searches({ game: rules, rows }) {
    const states = rows.map((row) => asState(rules, row));
    const player = fog.bySight((_, { evader: [{ x, y, v }] }) => [x, y, v]);
    return states.map((state, index) => player(fog.inFog(rules), state, { role: "pursuer", number: 0 }, states.slice(0, index + 1)));
  },
  /** The replay of a match. */
  match(sides) {
    const match = matchOf(sides);
    while (!match.isOver) match.step();
    return match.replay();
  },
  /** What a player sees of itself and of the other side that sees half a second late, in a game of steps as long. */
  sights() {
    const state = (index) => ({ pursuer: [{ x: 10 + index }], evader: [{ x: index, status: `at ${index}` }] });
    const seen = [];
    const late = players.seeingLate((_, { pursuer, evader }) => seen.push([pursuer[0].x, evader[0].x, evader[0].status]), 0.5);
    const states = [0, 1, 2].map(state);
    states.forEach((now, index) => late({ dt: 0.5 }, now, { role: "pursuer", number: 0 }, states.slice(0, index + 1)));
    return seen;
  },
  /**
   * Of the games that one side has lost: the last half second at which another would have done better, and from which on it does;
   * the first tries the other alone, and the second an evader's actions for a second or two, too.
   */
  hindsight({ me, stand, count, ...sides }) {
    const match = matchOf(sides);
    const other = findPlayer(stand, me);
    const isBetter = (number, first, steps) => {
      const tried = match.from(number, { ...match.players, [me]: [other] });
      const held = { ...match.players, [me]: [{ act: () => first }] };
      for (let left = 0; left < (me === "evader" ? 100 : 200) && !tried.isOver; left++) {
        if (first !== null) tried.players = left < steps ? held : { ...match.players, [me]: [other] };
        tried.step();
      }
      return tried.isOver ? tried.winner === me : me === "evader";
    };
    const lost = [];
    for (; match.number <= count; match.next()) {
      while (!match.isOver) match.step();
      if (match.winner === me || match.outcome.startsWith(me)) continue;
      const search = hindsight.lastChance(match, { role: me, number: 0 }, other);
      let answer = search.next();
      while (!answer.done) answer = search.next();
      const last = match.states.length - 1;
      const moments = Array.from({ length: Math.min(40, Math.floor(last / 5)) }, (_, index) => last - 5 * (index + 1));
      const after = moments.filter((number) => number >= (answer.value ?? 0));
      const first = me === "evader" ? [null, ...game.ACTIONS] : [null];
      lost.push({
        found: answer.value,
        alone: after.filter((number) => isBetter(number, null)),
        better: after.filter((number) => first.some((action) => [10, 20].some((steps) => isBetter(number, action, steps)))),
      });
    }
    return lost;
  },
  /** A level as a beginner plays it, or a player with a shield, against another: outcome and seconds. */
  levels: (all) => all.map(({ number, game: rules, bot, against }) => {
    const level = levels.LEVELS[number - 1];
    const own = ofBot(level, bot);
    const opponent = findPlayer({ name: `shielded:${against}`, late: players.DIFFICULTIES[level.difficulty].late }, game.other(level.side));
    const played = levels.ofLevel(level.game === "rush-hour" ? levels.inRushHour(rules) : rules, level);
    const sides = game.bySide((role) => [role === level.side ? own : opponent]);
    const match = new Match(played, sides, level.seed, levels.startOf(played, level));
    while (!match.isOver) match.step();
    return [match.outcome, match.seconds];
  }),
  /** The levels of scenarios, with who wins if somebody plays their lines, or others, against an agent of a file. */
  scenarios({ scenarios, plays, opponents }) {
    const catalogue = { scenarios, games: {} };
    const before = levels.LEVELS.length;
    levels.addScenarios(catalogue);
    const found = levels.LEVELS.slice(before).map((level) => {
      const [rules, rival] = [catalogue.games[level.game], game.other(level.side)];
      const opponent = findPlayer({ name: `shielded:${opponents[rival]}` }, rival);
      const winners = [level, ...plays[level.game]].map(({ hold, line }) => {
        const own = line.map((actions) => ({ act: (...seen) => actions[Math.floor((seen[3].length - 1) / hold)] ?? game.HOLD }));
        const sides = game.bySide((role) => (role === level.side ? own : [opponent]));
        const match = new Match(levels.ofLevel(rules, level), sides, level.seed, levels.startOf(rules, level));
        while (!match.isOver) match.step();
        return match.winner;
      });
      return { level, start: levels.startOf(rules, level), played: levels.ofLevel(rules, level), winners };
    });
    levels.LEVELS.length = before;
    return found;
  },
  read: (texts) => Promise.all(texts.map((text) => tried(Promise.resolve(text).then(file.readGame)))),
  survey: (texts) => texts.map((text) => survey(file.readGame(text))),
  links: (fragments) => Promise.all(fragments.map((fragment) => tried(file.fromFragment("#game=", fragment)))),
  /** What is played again from the links of games of some sizes, in fog or among movers where asked for, and what was played. */
  shared: (sizes) => Promise.all(sizes.map(async ([pursuers, evaders, isFoggy, movers]) => {
    const rules = game.inTeams(file.gameFrom({ max_steps: 9, movers: movers ?? undefined }), pursuers, evaders);
    const sides = { pursuer: Array(pursuers), evader: Array(evaders) };
    for (const side of Object.values(sides)) side.fill({ name: "ahead", words: "ahead", act: () => 7 });
    const played = new Match(isFoggy ? fog.inFog(rules) : rules, sides, 1);
    while (!played.isOver) played.step();
    const again = await share.fromReplayLink(await share.asReplayLink(played));
    while (!again.isOver) again.step();
    return [played, again].map((match) => [match.states, match.outcome, game.countsOf(match.game), Boolean(match.game.sensors)]);
  })),
  moves() {
    const made = plan.withWall(file.gameFrom({ arena: { x_max: 9, y_max: 7 } }), [1, 1], [6, 1]);
    const wall = { kind: "polygons", index: 0 };
    const corners = ({ arena }) => arena.polygons[0].vertices;
    const hall = plan.withWall(file.gameFrom({}), [2, 4], [8, 4]);
    return {
      joined: [[0.12, 3.04], [9.9, 6.87], [4.01, 4.2], [5.04, 5.01]].map((point) => plan.joined(hall, point)),
      corner: plan.withWall(hall, [8, 4], [8, 7]).arena.polygons[1].vertices,
      steep: corners(plan.withWall(file.gameFrom({}), [3, 1], [3, 4])),
      far: corners(plan.moved(made, wall, [100, -100])),
      crossed: corners(plan.resized(made, wall, 0, [8, 5])),
      small: plan.withSize(plan.withDisc(made, [8, 6], [8, 6.5]), 7, 7).arena.discs.length,
      nothing: plan.withBlock(made, [2, 3], [2, 5]) === made,
    };
  },
};
const found = Object.entries(asked).map(async ([name, question]) => [name, await answers[name](question)]);
console.log(JSON.stringify(Object.fromEntries(await Promise.all(found))));
