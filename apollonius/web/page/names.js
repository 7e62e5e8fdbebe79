// What players are called in words. Menus show the words; replays and addresses keep the names, as the command has them.

export const YOU = "you";
export const SHIELDED = "shielded:";
const WITH = "+"; // between a person and the mates

/** Return the leader of a side and, of a person, the name of the team mates: of `you+P_team` both, of `P_team` the first alone. */
export const leadAndMates = (name) => name.split(WITH);

/** A person with such mates, or without any. */
export const leading = (mates) => (mates ? YOU + WITH + mates : YOU);

/** Return whether a person plays, alone or with mates. */
export const isPerson = (name) => leadAndMates(name)[0] === YOU;

const WORDS = {
  [YOU]: "a person",
  any: "knows any arena",
  team: "hunts as a team",
  optimal: "taught by the solved game",
  hunter: "learned to catch the best evaders",
  prioritised: "learned from its own past, longest",
  robust: "ready for wheels and motors",
  smooth: "drives smoothly",
  pool: "learned from many evaders",
  curriculum: "learned step by step",
  scratch: "learned from nothing",
  random: "moves at random",
  stage1: "has only caught robots at rest",
  still: "stands still",
  "pure-pursuit": "drives at the other",
  intercept: "intercepts the other",
  "voronoi-pursuit": "shrinks the other's free space",
  encirclement: "surrounds the other",
  flee: "drives straight away",
  "flee-aware": "flees to open space",
  territory: "plays for the territory",
};
const TRAINED = { random: "learned against random moves" };

/** Without what is put before a name. */
export const bare = (name) => name.replace(SHIELDED, "");

/** A player in words, and its name where it has one: "knows any arena (P_any)". */
export function inWords(name) {
  const [lead, mates] = leadAndMates(name);
  if (mates) return `${inWords(lead)}; mates: ${inWords(mates)}`;
  const known = bare(name);
  const key = known.replace(/^[PE]_/, "");
  const isOfZoo = key !== known;
  const words = (isOfZoo && TRAINED[key]) || WORDS[key];
  if (words === undefined) return known;
  return known === YOU ? words : `${words} (${known})`;
}
