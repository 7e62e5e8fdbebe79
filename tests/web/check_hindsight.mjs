// Plays games of players by rules to their ends and looks back at those that one side has lost: a JSON object on standard
// input, another on standard output.
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const { page, game, me, own, theirs, stands, seed, count } = JSON.parse(readFileSync(0, "utf8"));
const load = (name) => import(pathToFileURL(`${page}/${name}`));
const [agents, { CLASSICAL }, { asHardAs }, { lastChance, standIns }, { Match }, rules] = await Promise.all(
  ["agents.js", "classical.js", "difficulty.js", "hindsight.js", "match.js", "rules.js"].map(load),
);

/** A player by {name, hard}; `forwards` goes straight on. */
function player({ name, hard = "sharp" }, role) {
  if (name === "forwards") return { name, isTold: false, act: () => rules.HOLD };
  const rule = agents.BUILT_IN[name] ?? agents.byValues(CLASSICAL[role][name]);
  const rank = agents.shielded(asHardAs(rule, hard));
  return { name, isTold: hard === "told", act: (...seen) => rank(...seen)[0] };
}

/** Whether a stand-in does better from a state on, in plain words of the rules: one robot on either side. */
function doesBetter({ states, players }, number, stand) {
  const both = { ...players, [me]: [stand] };
  const seen = states.slice(0, number + 1);
  const steps = Math.round((me === "evader" ? 10 : 20) / game.dt);
  for (let step = 0; step < steps; step++) {
    const ask = (role, told) => [both[role][0].act(game, seen.at(-1), { role, number: 0 }, seen, told)];
    const rival = rules.other(me);
    const tells = both.pursuer[0].isTold ? "evader" : "pursuer"; // who decides first
    const first = { [tells]: ask(tells) };
    const late = rules.other(tells);
    const { state, outcome } = rules.step(game, seen.at(-1), { ...first, [late]: ask(late, first[tells]) });
    seen.push(state);
    if (outcome === "no_result") return me === "evader";
    if (outcome !== "ongoing") return me === "pursuer" ? outcome === "captured" || outcome.startsWith(rival) : outcome.startsWith(rival);
  }
  return me === "evader";
}

const rival = rules.other(me);
const match = new Match(game, { [me]: [player(own, me)], [rival]: [player(theirs, rival)] }, seed);
const others = stands.map((stand) => player(stand, me));
const who = { role: me, number: 0 };
const lost = [];
for (; match.number <= count; match.next()) {
  while (!match.isOver) match.step();
  if (match.winner === me || match.outcome.startsWith(me)) continue;
  const search = lastChance(match, who, others);
  let [asked, answer] = [0, search.next()];
  for (; !answer.done; asked++) answer = search.next();
  const last = match.states.length - 1;
  const { number: found } = answer.value;
  const doubted = found === null ? [1, 2, 4, 7, 11, 17].map((back) => last - back) : [found, found + 1];
  const tried = doubted.filter((number) => number >= 0 && number < last);
  const better = tried.filter((number) => others.some((stand) => doesBetter(match, number, stand)));
  lost.push({ ...answer.value, asked, last, better });
}
const files = { P_any: "", E_any: "" };
const nobody = await standIns({ files: {} }, match, who);
const byChance = await standIns({ files }, { players: { ...match.players, [rival]: [{ name: "shielded:random (fair)" }] } }, who);
console.log(JSON.stringify({ lost, nobody, byChance }));
