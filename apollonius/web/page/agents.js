// Who acts: a player is a function from (game, state, role) to actions in the order it prefers them: all the discrete
// ones 0..8, and before them, of a player with continuous actions, its pair of gears.

import { clearanceAlong } from "./clearance.js";
import { observe } from "./observation.js";
import { gears, move } from "./rules.js";

const ACTIONS = [0, 1, 2, 3, 4, 5, 6, 7, 8];
const MARGIN = 1e-3;
const ESCAPES = [0, 1, 2];

/** A trained network from the bytes of its safetensors file: {header, layers}. */
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
  const layers = [];
  for (let index = 0; index <= header.depth; index++) {
    layers.push({ weight: array(`layers/${index}/weight`), bias: array(`layers/${index}/bias`) });
  }
  return { header, layers };
}

/** What a network says: fully connected layers with ReLU between them (Fig. 3). */
export function outputs(agent, observation) {
  let hidden = Float32Array.from(observation);
  agent.layers.forEach(({ weight, bias }, index) => {
    const last = index === agent.layers.length - 1;
    const width = hidden.length;
    const next = new Float32Array(bias.length);
    for (let row = 0, at = 0; row < bias.length; row++, at += width) {
      let sum = bias[row];
      for (let column = 0; column < width; column++) sum += weight[at + column] * hidden[column];
      next[row] = last ? sum : Math.max(sum, 0);
    }
    hidden = next;
  });
  return hidden;
}

/** Actions by falling value; among equals, the lowest comes first. */
const byValue = (values) => ACTIONS.toSorted((a, b) => values[b] - values[a] || a - b);

/** The gears that two means stand for, then the discrete actions, those with the nearest gears first. */
function byNearness(means) {
  const own = [...means.map(Math.tanh)]; // in single precision, as a replay holds them
  const away = (action) => gears(action).reduce((sum, gear, index) => sum + (gear - own[index]) ** 2, 0);
  return [own, ...byValue(ACTIONS.map((action) => -away(action)))];
}

/** What a network's outputs say to do, by its kind: the values of the 9 actions, or means and spreads of two gears. */
const PREFERENCES = { values: byValue, gaussian: (said) => byNearness(said.subarray(0, 2)) };

/** A trained agent without exploration. */
export function atBest(agent) {
  const { observation, network = "values" } = agent.header;
  return (game, state, role) => PREFERENCES[network](outputs(agent, observe(observation, game, state, role)));
}

/** What a state is worth to a trained agent, if it values actions: what its best one is worth. */
export function worthTo(agent) {
  const { observation, network = "values" } = agent.header;
  if (network !== "values") return null;
  return (game, state, role) => Math.max(...outputs(agent, observe(observation, game, state, role)));
}

/** A player that takes the best of the actions by some values: from (game, state, role) to the nine of them. */
export const byValues = (values) => (game, state, role) => byValue(values(game, state, role));

/** Players that need no file. */
export const BUILT_IN = {
  random: () => [Math.floor(Math.random() * ACTIONS.length), ...ACTIONS],
  still: () => [1, ...ACTIONS],
};

/** Least clearance [m] during an action and the best of three ways to brake to rest after it (agents/shield.py). */
function roomAfter(game, body, robot, action) {
  const after = move(body, robot, action, game.dt);
  const room = clearanceAlong(game.arena, robot, after);
  const steps = Math.ceil(body.v_max / (body.u1_max * game.dt));
  const escapes = ESCAPES.map((gear) => {
    let [least, at] = [room, after];
    for (let step = 0; step < steps; step++) {
      const next = move(body, at, gear, game.dt);
      least = Math.min(least, clearanceAlong(game.arena, at, next));
      at = next;
    }
    return least;
  });
  return Math.max(...escapes) - body.radius;
}

/** Another player, held back to the first of its actions after which its robot can stop in time. */
export function shielded(player) {
  return (game, state, role, ...rest) => {
    const room = (action) => roomAfter(game, game[role], state[role], action);
    const action = player(game, state, role, ...rest).find((wanted) => room(wanted) > MARGIN);
    return action === undefined ? byValue(ACTIONS.map(room)) : [action];
  };
}
