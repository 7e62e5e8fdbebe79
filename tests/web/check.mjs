// Answers questions about the page's rules, players and replays: a JSON object on standard input, another on standard
// output.
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const { page, games = [], agent, observations = [], positions = [], match, charts = [], views, chases, sights } = JSON.parse(readFileSync(0, "utf8"));
const rules = await import(pathToFileURL(`${page}/rules.js`));
const agents = await import(pathToFileURL(`${page}/agents.js`));
const { observe } = await import(pathToFileURL(`${page}/observation.js`));
const { chartOf } = await import(pathToFileURL(`${page}/charting.js`));
const { CLASSICAL, fits } = await import(pathToFileURL(`${page}/classical.js`));
const { asHardAs } = await import(pathToFileURL(`${page}/difficulty.js`));
const { Match } = await import(pathToFileURL(`${page}/match.js`));
const { roomAfter } = await import(pathToFileURL(`${page}/braking.js`));
const { bodyOf, countsOf, robotOf } = await import(pathToFileURL(`${page}/teams.js`));

/** What all robots have in a row, as either side has it. */
const bySide = (game, all) => {
  const [pursuers] = countsOf(game);
  return { pursuer: all.slice(0, pursuers), evader: all.slice(pursuers) };
};
const asRow = ({ pursuer, evader }) => [...pursuer, ...evader].flatMap(({ x, y, v, heading }) => [x, y, v, heading]);
const asState = (game, row, statuses = []) => {
  const robots = Array.from({ length: row.length / 4 }, (_, index) => {
    const [x, y, v, heading] = row.slice(4 * index);
    return { x, y, v, heading, status: statuses[index] ?? "active" };
  });
  return { ...bySide(game, robots), steps: 0 };
};

function play({ game, states, actions }) {
  let state = asState(game, states[0]);
  const [rows, outcomes, statuses] = [[asRow(state)], [], []];
  for (const all of actions) {
    const after = rules.step(game, state, bySide(game, all));
    state = after.state;
    rows.push(asRow(state));
    outcomes.push(after.outcome);
    statuses.push([...state.pursuer, ...state.evader].map(({ status }) => status));
  }
  return { rows, outcomes, statuses };
}

function read(path) {
  const bytes = readFileSync(path);
  return agents.readAgent(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength));
}

/** A player of a match, by its name: built in, or the path of an agent's file. */
function findPlayer(name) {
  const player = agents.BUILT_IN[name] ?? agents.atBest(read(name));
  return { name, act: (...seen) => player(...seen)[0] };
}

/** What a chart says, with the ways from some stops. */
function drawChart({ game, stops }) {
  const { field, beside, ways } = chartOf(game);
  return { field: [...field], beside: [...beside], ways: stops.map((stop) => [...ways.from(stop)]) };
}

/** Outcomes of games of a shielded trained pursuer, as hard as asked for, against a shielded evader. */
function chase({ game, agents: folder, pursuer, evader, difficulty, seed, count }) {
  const network = read(`${folder}/${pursuer}.safetensors`);
  const hard = agents.shielded(asHardAs(agents.atBest(network), difficulty, (...seen) => Math.max(...agents.valuesOf(network)(...seen))));
  const rule = CLASSICAL.evader[evader];
  const flees = agents.shielded(rule ? agents.byValues(rule) : agents.atBest(read(`${folder}/${evader}.safetensors`)));
  const player = (rank, isTold) => ({ isTold, act: (...seen) => rank(...seen)[0] });
  const played = new Match(game, { pursuer: [player(hard, difficulty === "told")], evader: [player(flees, false)] }, seed);
  return Array.from({ length: count }, () => {
    while (!played.isOver) played.step();
    const { outcome } = played;
    played.next();
    return outcome;
  });
}

/** What a player sees that sees half a second late, in a game of steps as long, and the order of one that is told. */
function look() {
  const state = (index) => ({ pursuer: [{ x: 10 + index }], evader: [{ x: index }] });
  const seen = [];
  const watching = (game, { pursuer, evader }) => seen.push([pursuer[0].x, evader[0].x]);
  const late = asHardAs(watching, "fair");
  const states = [0, 1, 2].map(state);
  states.forEach((now, index) => late({ dt: 0.5 }, now, { role: "pursuer", number: 0 }, states.slice(0, index + 1)));
  const order = [];
  const player = (isTold, action) => ({ isTold, act: (...rest) => (order.push(rest[4]?.[0] ?? action), action) });
  const body = { v_min: 0, v_max: 1, u1_max: 1, u2_max: 1, radius: 0 };
  const arena = { x_min: 0, x_max: 9, y_min: 0, y_max: 9, discs: [], polygons: [] };
  const starts = { speed: "rest", clearance: 0.3, separation: 1 };
  const game = { arena, pursuer: body, evader: body, starts, dt: 0.1, max_steps: 9, capture_distance: 0.1, reward: {} };
  new Match(game, { pursuer: [player(true, 4)], evader: [player(false, 5)] }, 0).step();
  return { own: seen.map(([own]) => own), late: seen.map(([, other]) => other), told: [order[0], order[1] === 5 ? 4 : -1] };
}

const answer = { games: games.map(play), charts: charts.map(drawChart) };
if (agent) {
  const network = read(agent.path);
  const [bare, behindShield] = [agents.atBest(network), agents.shielded(agents.atBest(network))];
  const { game, role, number = 0, statuses = [] } = agent;
  const seen = positions.map((row, index) => [game, asState(game, row, statuses[index]), { role, number }]);
  const chosen = (player) => seen.map((one) => rules.gears(player(...one)[0]));
  answer.outputs = observations.map((observation) => [...agents.outputs(network, observation)]);
  answer.observed = seen.map((one) => observe(network.header.observation, ...one));
  [answer.gears, answer.shielded] = [chosen(bare), chosen(behindShield)];
}
if (match) {
  const sides = countsOf(match.game).map((count, side) => Array(count).fill(findPlayer(match[rules.ROLES[side]])));
  const played = new Match(match.game, { pursuer: sides[0], evader: sides[1] }, match.seed);
  while (!played.isOver) played.step();
  answer.replay = played.replay();
}
if (views) {
  const { game, role, number, statuses, rows, observations: names } = views;
  const seen = rows.map((row, index) => [game, asState(game, row, statuses[index]), { role, number }]);
  const each = (pairs) => Object.fromEntries(pairs.map(([name, ask]) => [name, seen.map((one) => ask(...one))]));
  answer.seen = each(names.map((name) => [name, (...one) => observe(name, ...one)]));
  answer.values = each(Object.entries(CLASSICAL[role]).filter(([name]) => fits(name, game)));
  answer.rooms = seen.map(([, state, who]) => [...Array(9).keys()].map((action) => roomAfter(game, bodyOf(game, who), robotOf(state, who), action)));
}
if (chases) answer.chases = chase(chases);
if (sights) answer.sights = look();
console.log(JSON.stringify(answer));
