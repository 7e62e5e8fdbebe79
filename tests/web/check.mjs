// Answers questions about the page's rules and players: a JSON object on standard input, another on standard output.
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const { page, games = [], agent, observations = [], positions = [] } = JSON.parse(readFileSync(0, "utf8"));
const rules = await import(pathToFileURL(`${page}/rules.js`));
const agents = await import(pathToFileURL(`${page}/agents.js`));

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

const answer = { games: games.map(play) };
if (agent) {
  const bytes = readFileSync(agent.path);
  const network = agents.readAgent(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength));
  const [bare, behindShield] = [agents.greedy(network), agents.shielded(agents.greedy(network))];
  answer.values = observations.map((observation) => [...agents.actionValues(network, observation)]);
  answer.observed = positions.map((row) => rules.observe(network.header.observation, agent.game, asState(row), agent.role));
  answer.actions = positions.map((row) => bare(agent.game, asState(row), agent.role)[0]);
  answer.shielded = positions.map((row) => behindShield(agent.game, asState(row), agent.role)[0]);
}
console.log(JSON.stringify(answer));
