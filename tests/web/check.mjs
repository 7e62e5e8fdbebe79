// Answers questions about the page's modules: a JSON object on standard input, another on standard output.
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const { page, ...asked } = JSON.parse(readFileSync(0, "utf8"));
const load = (name) => import(pathToFileURL(`${page}/${name}.js`));
const [game, calls, agents, players, programs, { Match }, { makeRandom }, hindsight, file, plan, { survey }] = await Promise.all(
  ["game", "calls", "agents", "players", "programs", "match", "starts", "hindsight", "gamefile", "plan", "survey"].map(load),
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

function read(path) {
  const bytes = readFileSync(path);
  return agents.readAgent(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength));
}

/** A player of a match by {name, hard}: `forwards`, a rule, or the path of an agent's file; `shielded:` may stand before it. */
function findPlayer({ name, hard = "sharp" }, role) {
  const known = name.replace("shielded:", "");
  if (known === "forwards") return { name, isTold: false, act: () => game.HOLD };
  const [rule, network] = [calls.CLASSICAL[role][known], known.endsWith(".safetensors") && read(known)];
  const player = agents.BUILT_IN[known] ?? (rule ? agents.byValues(rule) : agents.atBest(network));
  const worth = network && agents.valuesOf(network) ? (...seen) => Math.max(...agents.valuesOf(network)(...seen)) : null;
  const able = players.asHardAs(player, hard, worth);
  const rank = name === known ? able : agents.shielded(able);
  return { name, isTold: hard === "told", act: (...seen) => rank(...seen)[0] };
}

const matchOf = ({ game: rules, seed, ...sides }) => {
  const counts = game.countsOf(rules);
  const found = game.ROLES.map((role, side) => [role, Array(counts[side]).fill(findPlayer(sides[role], role))]);
  return new Match(rules, Object.fromEntries(found), seed);
};

/** A game as somebody in a hurry would draw it: three discs, and eleven walls and blocks. */
function drawn(random) {
  const within = (low, high) => low + (high - low) * random();
  let made = plan.withSize(plan.cleared(file.gameFrom({})), Math.round(within(8, 20)), Math.round(within(8, 20)));
  const { x_max: width, y_max: height } = made.arena;
  const place = (room = 0) => plan.snapped([within(room, width - room), within(room, height - room)]);
  const around = ([x, y], far) => plan.snapped([x + within(-far, far), y + within(-far, far)]);
  for (let disc = 0; disc < 3; disc++) made = plan.withDisc(made, place(), within(0.1, 0.8));
  const room = place(2);
  made = plan.withRoom(made, room, plan.snapped([room[0] + within(2, 5), room[1] + within(2, 5)]));
  const corridor = place(2);
  made = plan.withCorridor(made, corridor, around(corridor, 3));
  const wall = place(1);
  const end = around(wall, 3);
  made = plan.withDoor(plan.withWall(made, wall, end), [(wall[0] + end[0]) / 2, (wall[1] + end[1]) / 2]);
  for (let block = 0; block < 2; block++) {
    const corner = place();
    made = plan.withBlock(made, corner, around(corner, 2));
  }
  for (let change = 0; change < 6; change++) {
    const [kind, far] = [random() < 0.3 ? "discs" : "polygons", [within(-2, 2), within(-2, 2)]];
    const shape = { kind, index: Math.floor(random() * made.arena[kind].length) };
    made = plan.moved(made, shape, plan.snapped(far));
    const grips = plan.handles(made, shape).grips;
    const grip = Math.floor(random() * grips.length);
    made = plan.resized(made, shape, grip, around(grips[grip], 0.5));
  }
  const body = () => ({ ...file.DEFAULT.pursuer, v_max: within(0.5, 2), u1_max: within(0.1, 1), u2_max: within(0.2, 2), radius: within(0, 0.25) });
  return file.gameFrom({ ...made, pursuer: body(), evader: body(), capture_distance: within(0.2, 0.6) });
}

/** What comes of a question, or the complaint. */
const tried = (work) => {
  try {
    return { answer: work() };
  } catch (error) {
    return { complaint: error.message };
  }
};

/** Whether another player does better than a robot from a state on, in plain words of the rules: one robot on either side. */
function doesBetter({ game: rules, states, players: both }, me, number, stand) {
  const sides = { ...both, [me]: [stand] };
  const seen = states.slice(0, number + 1);
  const steps = Math.round((me === "evader" ? 10 : 20) / rules.dt);
  const rival = game.other(me);
  for (let step = 0; step < steps; step++) {
    const ask = (role, told) => [sides[role][0].act(rules, seen.at(-1), { role, number: 0 }, seen, told)];
    const tells = sides.pursuer[0].isTold ? "evader" : "pursuer"; // who decides first
    const first = { [tells]: ask(tells) };
    const late = game.other(tells);
    const { state, outcome } = calls.step(rules, seen.at(-1), { ...first, [late]: ask(late, first[tells]) });
    seen.push(state);
    if (outcome === "no_result") return me === "evader";
    if (outcome !== "ongoing") return me === "pursuer" ? outcome === "captured" || outcome.startsWith(rival) : outcome.startsWith(rival);
  }
  return me === "evader";
}

const answers = {
  /** States, outcomes and statuses of a game by its actions. */
  games: (all) => all.map(({ game: rules, states, actions }) => {
    let state = asState(rules, states[0]);
    const [rows, outcomes, statuses] = [[asRow(state)], [], []];
    for (const taken of actions) {
      const after = calls.step(rules, state, bySide(rules, taken));
      state = after.state;
      rows.push(asRow(state));
      outcomes.push(after.outcome);
      statuses.push([...state.pursuer, ...state.evader].map(({ status }) => status));
    }
    return { rows, outcomes, statuses };
  }),
  chart(rules) {
    calls.pathsFrom(rules, { x: rules.arena.x_min + 1, y: rules.arena.y_min + 1 });
    const { field, visible, lengths } = programs.given.chart();
    return { field: [...field], visible: [...visible], lengths: Buffer.from(lengths.buffer, lengths.byteOffset, lengths.byteLength).toString("base64") };
  },
  agent({ path, game: rules, role, observations, rows }) {
    const network = read(path);
    const chosen = (player) => rows.map((row) => game.gears(player(rules, asState(rules, row), { role, number: 0 })[0]));
    const outputs = observations.map((observation) => [...agents.outputs(network, observation)]);
    return { outputs, levels: chosen(agents.atBest(network)), shielded: chosen(agents.shielded(agents.atBest(network))) };
  },
  views({ game: rules, role, number, statuses, rows, observations }) {
    const seen = rows.map((row, index) => [rules, asState(rules, row, statuses[index]), { role, number }]);
    const each = (pairs) => Object.fromEntries(pairs.map(([name, ask]) => [name, seen.map((one) => ask(...one))]));
    const fitting = Object.entries(calls.CLASSICAL[role]).filter(([name]) => calls.fits(name, rules, game.countsOf(rules)[0]));
    const room = ([, state, who]) => game.ACTIONS.map((action) => calls.roomAfter(rules, game.bodyOf(rules, who), game.robotOf(state, who), action));
    return { seen: each(observations.map((name) => [name, (...one) => calls.observe(name, ...one)])), values: each(fitting), clearances: seen.map(room) };
  },
  /** Replays of the first games of a match, or their outcomes alone. */
  match({ count = 1, outcomes = false, ...sides }) {
    const match = matchOf(sides);
    return Array.from({ length: count }, () => {
      while (!match.isOver) match.step();
      const found = outcomes ? match.outcome : match.replay();
      match.next();
      return found;
    });
  },
  /** What a player sees that sees half a second late, in a game of steps as long, and the order of one that is told. */
  sights() {
    const state = (index) => ({ pursuer: [{ x: 10 + index }], evader: [{ x: index }] });
    const seen = [];
    const late = players.asHardAs((_, { pursuer, evader }) => seen.push([pursuer[0].x, evader[0].x]), "fair");
    const states = [0, 1, 2].map(state);
    states.forEach((now, index) => late({ dt: 0.5 }, now, { role: "pursuer", number: 0 }, states.slice(0, index + 1)));
    const order = [];
    const player = (isTold, action) => ({ isTold, act: (...rest) => (order.push(rest[4]?.[0] ?? action), action) });
    new Match(file.gameFrom({}), { pursuer: [player(true, 4)], evader: [player(false, 5)] }, 0).step();
    return { own: seen.map(([own]) => own), late: seen.map(([, other]) => other), told: [order[0], order[1] === 5 ? 4 : -1] };
  },
  /** Of the games that one side has lost: from when another would have done better, and from which states in doubt it does. */
  hindsight({ me, stands, count, ...sides }) {
    const match = matchOf(sides);
    const others = stands.map((stand) => findPlayer(stand, me));
    const lost = [];
    for (; match.number <= count; match.next()) {
      while (!match.isOver) match.step();
      if (match.winner === me || match.outcome.startsWith(me)) continue;
      const search = hindsight.lastChance(match, { role: me, number: 0 }, others);
      let [steps, answer] = [0, search.next()];
      for (; !answer.done; steps++) answer = search.next();
      const last = match.states.length - 1;
      const { number: found } = answer.value;
      const doubted = found === null ? [1, 2, 4, 7, 11, 17].map((back) => last - back) : [found, found + 1];
      const near = doubted.filter((number) => number >= 0 && number < last);
      const better = near.filter((number) => others.some((stand) => doesBetter(match, me, number, stand)));
      lost.push({ ...answer.value, steps, last, better });
    }
    return lost;
  },
  fuzz({ seed, count }) {
    const found = [];
    for (let next = seed; found.length < count; next++) {
      const { answer: made } = tried(() => drawn(makeRandom(next)));
      if (made?.arena.polygons.length !== 11) continue; // some shapes come to nothing
      const linked = file.fromFragment(file.asFragment(made));
      found.push({ game: made, file: file.writeGame(made), isSame: JSON.stringify(linked) === JSON.stringify(made) });
    }
    return found;
  },
  read: (texts) => texts.map((text) => tried(() => file.readGame(text))),
  survey: (text) => survey(file.readGame(text)).wrong,
  /** What comes of links with noise in them. */
  links({ seed, count }) {
    const random = makeRandom(seed);
    const whole = file.gameFrom({ arena: { discs: [{ x: 3, y: 3, radius: 0.5 }] } });
    const [fragment, text] = [file.asFragment(whole), file.writeGame(whole)];
    const asLink = (text) => `#game=${Buffer.from(text, "latin1").toString("base64url")}`;
    const changed = (letters) => {
      const [at, length] = [Math.floor(random() * letters.length), Math.floor(random() * 9)];
      const noise = Array.from({ length: Math.floor(random() * 9) }, () => String.fromCharCode(Math.floor(random() * 256))).join("");
      return letters.slice(0, at) + noise + letters.slice(at + length);
    };
    return Array.from({ length: count }, (_, index) => {
      const { answer, complaint } = tried(() => file.fromFragment(index % 2 ? changed(fragment) : asLink(changed(text))));
      return complaint ?? (answer ? "played" : "none");
    });
  },
  moves() {
    const made = plan.withWall(file.gameFrom({ arena: { x_max: 9, y_max: 7 } }), [1, 1], [6, 1]);
    const wall = { kind: "polygons", index: 0 };
    const corners = ({ arena }) => arena.polygons[0].vertices;
    return {
      door: plan.withDoor(made, [3, 1.05]).arena.polygons.map(({ vertices }) => vertices),
      room: plan.withRoom(made, [2, 2], [6, 6]).arena.polygons.length - 1,
      far: corners(plan.moved(made, wall, [100, -100])),
      crossed: corners(plan.resized(made, wall, 0, [8, 5])),
      small: plan.withSize(plan.withDisc(made, [8, 6], 0.5), 7, 7).arena.discs.length,
      nothing: plan.withBlock(made, [2, 3], [2, 5]) === made,
    };
  },
};
console.log(JSON.stringify(Object.fromEntries(Object.entries(asked).map(([name, question]) => [name, answers[name](question)]))));
