// Who acts: a player is a function from (game, state, who), the robot {role, number} that is to act, to actions in the order
// it prefers them: all the discrete ones 0..8, and before them, of a player with continuous actions, its pair of levels.

import { canStop, observe, clearanceAfter } from "./calls.js";
import { ACTIONS, actionLevels, bodyOf, robotOf } from "./game.js";
import { addresses, given, kept, run } from "./programs.js";

const UNITS = 64; // of a layer that are worked out together, whose weights lie together

/** Read a trained network from the bytes of its safetensors file: {header, sizes, weights}. */
export function readAgent(buffer) {
  const view = new DataView(buffer);
  const length = Number(view.getBigUint64(0, true));
  const entries = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 8, length)));
  const header = JSON.parse(entries.__metadata__.header);
  if (header.format !== "apollonius-agent" || header.version !== 1) {
    throw new Error("not an agent that this page can read");
  }
  const array = (name) => {
    const { dtype, data_offsets: offsets } = entries[name];
    if (dtype !== "F32") throw new Error(`${name} is ${dtype}, not F32`);
    // A copy, since the bytes in the file need not lie at a multiple of four.
    return new Float32Array(buffer.slice(8 + length + offsets[0], 8 + length + offsets[1]));
  };
  const layers = Array.from({ length: header.depth + 1 }, (_, index) => [array(`layers/${index}/weight`), array(`layers/${index}/bias`)]);
  const sizes = [layers[0][0].length / layers[0][1].length, ...layers.map(([, bias]) => bias.length)];
  return { header, sizes, weights: kept(layers.map(inBlocks)) };
}

/** A layer as `network` of `apollonius/web/programs.py` reads it: for some units at a time biases, then weights by inputs. */
function inBlocks([weight, bias]) {
  const inputs = weight.length / bias.length;
  const block = (inputs + 1) * UNITS;
  const found = new Float32Array(Math.ceil(bias.length / UNITS) * block);
  bias.forEach((value, unit) => {
    const first = Math.floor(unit / UNITS) * block + (unit % UNITS);
    found[first] = value;
    for (let input = 0; input < inputs; input++) found[first + (input + 1) * UNITS] = weight[unit * inputs + input];
  });
  return found;
}

/** Return the outputs of a network: fully connected layers with ReLU between them (Fig. 3). */
export function outputs({ sizes, weights }, observation) {
  addresses.weights = weights;
  given.sizes().set(sizes);
  given.inputs().set(observation);
  return run.network(sizes.length - 1).slice(0, sizes.at(-1));
}

/** Actions by falling value; among equals, the lowest comes first. */
const byValue = (values) => ACTIONS.toSorted((a, b) => values[b] - values[a] || a - b);

/** Return the pair of levels that two means stand for, then the discrete actions, the nearest first. */
function byNearness(means) {
  const own = [...means.map(Math.tanh)]; // in single precision, as a replay holds them
  const away = (action) => actionLevels(action).reduce((sum, level, index) => sum + (level - own[index]) ** 2, 0);
  return [own, ...byValue(ACTIONS.map((action) => -away(action)))];
}

/** The order of actions by a network's outputs: values of the 9 actions, or means and spreads of two levels. */
const PREFERENCES = { values: byValue, gaussian: (said) => byNearness(said.subarray(0, 2)) };

/** A trained agent without exploration. */
export function atBest(agent) {
  const { observation, network = "values" } = agent.header;
  return (...seen) => PREFERENCES[network](outputs(agent, observe(observation, ...seen)));
}

/** Return a function from (game, state, who) to the values of the nine actions, or null for an agent without values. */
export function valuesOf(agent) {
  const { observation, network = "values" } = agent.header;
  return network === "values" ? (...seen) => outputs(agent, observe(observation, ...seen)) : null;
}

/** Return the player that prefers actions of higher value. */
export const byValues = (values) => (...seen) => byValue(values(...seen));

/** Players that need no file. */
export const BUILT_IN = {
  random: () => [Math.floor(Math.random() * ACTIONS.length), ...ACTIONS],
  still: () => [1, ...ACTIONS],
};

/** Another player, held back to the first of its actions after which its robot can stop in time. */
export function shielded(player) {
  return (game, state, who, ...rest) => {
    const [body, robot] = [bodyOf(game, who), robotOf(state, who)];
    const action = player(game, state, who, ...rest).find((wanted) => canStop(game, body, robot, wanted));
    return action === undefined ? byValue(ACTIONS.map((wanted) => clearanceAfter(game, body, robot, wanted))) : [action];
  };
}
