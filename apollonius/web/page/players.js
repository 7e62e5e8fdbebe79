// Who acts: people, trained agents, rules, and the shield before any of them.
//
// A player is a function from (game, state, who), the robot {role, number} that is to act, to actions in the order it prefers
// them: all the discrete ones 0..8, and before them, of a player with continuous actions, its pair of levels. Robots are the
// same at every difficulty: an easier opponent sees the other side late. Its own robot it always sees as it is, so that a
// shield stays a shield.

import { CHARTED, CLASSICAL, canStop, clearanceAfter, fits, observe, readOwn } from "./calls.js";
import { load } from "./files.js";
import { bySight } from "./fog.js";
import { ACTIONS, EVADER, PURSUER, actionLevels, other } from "./game.js";
import { addresses, given, kept, run } from "./programs.js";
import { SHIELDED, YOU, bare, inWords } from "./words.js";

const UNITS = 64; // of a layer that are worked out together, whose weights lie together

/** Read a trained network, which the package has checked, from the bytes of its file: {header, sizes, weights}. */
export function readAgent(buffer) {
  const view = new DataView(buffer);
  const length = Number(view.getBigUint64(0, true));
  const entries = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 8, length)));
  const header = JSON.parse(entries.__metadata__.header);
  const array = (name) => {
    const [begin, end] = entries[name].data_offsets;
    return new Float32Array(buffer.slice(8 + length + begin, 8 + length + end)); // a copy: bytes in a file are not aligned
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

/** Return the outputs of a network: fully connected layers with ReLU between them (Fig. 3), of a symmetric one for both sides. */
export function outputs({ header, sizes, weights }, observation) {
  addresses.weights = weights;
  given.sizes().set(sizes);
  given.inputs().set(observation);
  return run.network(sizes.length - 1, Number(header.symmetric ?? false)).slice(0, sizes.at(-1));
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

/** A trained agent without exploration: as a player, and its values of the nine actions; null of one without values. */
export function trained(agent) {
  const { observation, network = "values", role, clearance_margin: margin = 0, loss_value: lossValue } = agent.header;
  const bare = (...seen) => outputs(agent, observe(observation, ...seen));
  const penalised = (...seen) => {
    const values = bare(...seen);
    const penalty = run.clearance_penalty(margin, lossValue); // by the observation, which `outputs` has left in memory
    return values.map((value, action) => value - penalty[action]);
  };
  const values = margin > 0 ? penalised : bare;
  const departing = (...seen) => {
    const costs = observe("departure_costs", ...seen);
    return values(...seen).map((value, action) => value - costs[action]);
  };
  const says = role === PURSUER && network === "values" && CHARTED.includes(observation) ? departing : values;
  return { player: (...seen) => PREFERENCES[network](says(...seen)), values: network === "values" ? says : null };
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
    const action = player(game, state, who, ...rest).find((wanted) => canStop(game, state, who, wanted));
    return action === undefined ? byValue(ACTIONS.map((wanted) => clearanceAfter(game, state, who, wanted))) : [action];
  };
}

// ---- by name

/** Agents of either side that know any arena: those a person meets, leads, and is replaced by. */
export const ANYWHERE = { [PURSUER]: "pursuer", [EVADER]: "evader" };

/** Difficulties, the gentlest first: label, in short, delay of what is seen [s]. */
export const DIFFICULTIES = {
  gentle: { words: "gentle: sees where you were a second ago", short: "sees a second late", late: 1 },
  fair: { words: "fair: sees where you were half a second ago", short: "sees half a second late", late: 0.5 },
  sharp: { words: "sharp: sees you at once", late: 0 },
};

/**
 * A player that sees the opponents where they were some seconds ago, but none in play that is no more.
 *
 * @param player from (game, state, who) to actions in the order it prefers them
 * @returns from (game, state, who, states) to such actions; `states` are all of the game
 */
export function seeingLate(player, seconds) {
  return (game, state, who, states) => {
    const rival = other(who.role);
    const before = states[Math.max(0, states.length - 1 - Math.round(seconds / game.dt))];
    const late = before[rival].map((robot, number) => ({ ...robot, status: state[rival][number].status }));
    return player(game, { ...state, [rival]: late }, who);
  };
}

/** Return the names of a side's players that need no file and can play in a game with these numbers of robots. */
export function ruleNames(side, game, counts) {
  return [...Object.keys(CLASSICAL[side]).filter((name) => fits(name, game, counts[0])), ...Object.keys(BUILT_IN)];
}

/** Return who plays each of the robots of one side: all are alike, but for the mates of a person. */
export async function findTeam(catalogue, name, role, count, difficulty, steer) {
  const first = await findPlayer(catalogue, name, role, difficulty, steer);
  const mate = name === YOU && count > 1 ? await findPlayer(catalogue, SHIELDED + ANYWHERE[role], role, "sharp") : first;
  return Array.from({ length: count }, (_, number) => (number ? mate : first));
}

/**
 * Who plays a robot of one side.
 *
 * @param catalogue of the page
 * @param name of the player; `shielded:` may stand before it
 * @param role the side
 * @param difficulty a name in `DIFFICULTIES`
 * @param steer what a person does: from a side and what a player is given to an action
 * @returns {name, words, act, values}: `values` are what it thinks of the nine actions; null of people, and of who has no opinion
 */
export async function findPlayer(catalogue, name, role, difficulty, steer) {
  if (name === YOU) return { name, words: inWords(name), values: null, act: (...seen) => steer(role, ...seen) };
  const known = bare(name);
  const { player, values } = await findBare(catalogue, known, role);
  const { late, short } = DIFFICULTIES[difficulty];
  const seeing = bySight(late ? seeingLate(player, late) : player);
  const ranked = name === known ? seeing : shielded(seeing);
  const [called, words] = late ? [`${name} (${difficulty})`, `${inWords(name)}, ${short}`] : [name, inWords(name)];
  return { name: called, words, values, act: (...seen) => ranked(...seen)[0] };
}

async function findBare(catalogue, name, role) {
  if (Object.hasOwn(BUILT_IN, name)) return { player: BUILT_IN[name], values: null };
  if (Object.hasOwn(CLASSICAL[role], name)) return { player: byValues(CLASSICAL[role][name]), values: CLASSICAL[role][name] };
  const isOwn = catalogue.files[name]?.endsWith(".wasm"); // of a user's own, and no network
  return load(name, catalogue.files[name], isOwn ? readOwn : (buffer) => trained(readAgent(buffer)));
}
