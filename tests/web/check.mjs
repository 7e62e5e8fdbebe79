// Answers questions about the page's rules, players and replays: a JSON object on standard input, another on standard
// output.
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const { page, games = [], agent, observations = [], positions = [], match, charts = [] } = JSON.parse(readFileSync(0, "utf8"));
const rules = await import(pathToFileURL(`${page}/rules.js`));
const agents = await import(pathToFileURL(`${page}/agents.js`));
const { observe } = await import(pathToFileURL(`${page}/observation.js`));
const { chartOf } = await import(pathToFileURL(`${page}/charting.js`));
const { Match } = await import(pathToFileURL(`${page}/match.js`));

const asRow = ({ pursuer: p, evader: e }) => [p.x, p.y, p.v, p.heading, e.x, e.y, e.v, e.heading];
const asState = (row, steps = 0) => {
  const [pursuer, evader] = [row.slice(0, 4), row.slice(4)].map(([x, y, v, heading]) => ({ x, y, v, heading }));
  return { pursuer, evader, steps };
};

function play({ game, states, actions }) {
  let state = asState(states[0]);
  const rows = [asRow(state)];
  const outcomes = [];
  for (const [pursuer, evader] of actions) {
    const after = rules.step(game, state, { pursuer, evader });
    state = after.state;
    rows.push(asRow(state));
    outcomes.push(after.outcome);
  }
  return { rows, outcomes };
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

const answer = { games: games.map(play), charts: charts.map(drawChart) };
if (agent) {
  const network = read(agent.path);
  const [bare, behindShield] = [agents.atBest(network), agents.shielded(agents.atBest(network))];
  const chosen = (player) => positions.map((row) => rules.gears(player(agent.game, asState(row), agent.role)[0]));
  answer.outputs = observations.map((observation) => [...agents.outputs(network, observation)]);
  answer.observed = positions.map((row) => observe(network.header.observation, agent.game, asState(row), agent.role));
  [answer.gears, answer.shielded] = [chosen(bare), chosen(behindShield)];
}
if (match) {
  const played = new Match(match.game, { pursuer: findPlayer(match.pursuer), evader: findPlayer(match.evader) }, match.seed);
  while (!played.isOver) played.step();
  answer.replay = played.replay();
}
console.log(JSON.stringify(answer));
