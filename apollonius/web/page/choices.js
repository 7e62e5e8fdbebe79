// What a person may choose, in the menu and in the page's address: a level, or who plays either side, an arena, how many
// robots, how hard, a seed.

import { MOST_ROBOTS } from "./calls.js";
import { EVADER, PURSUER, ROLES, countsOf, other, partsOf, teamName } from "./game.js";
import { LEVELS, bestOf, levelOf } from "./levels.js";
import { SHIELDED, YOU, bare, inWords, isPerson, leadAndMates, leading } from "./names.js";
import { DIFFICULTIES, ruleNames } from "./players.js";

const AT_HOME = ["paper", "zero-sum"]; // games in the arena that most agents were trained in
const ANYWHERE = { [PURSUER]: "P_any", [EVADER]: "E_any" };
const MATES = { [PURSUER]: "P_team", [EVADER]: "E_any" }; // whom a person leads
const SIZES = [[1, 1], [2, 1], [3, 1], [3, 2]]; // pursuers and evaders

const group = (label, options) => {
  const made = document.createElement("optgroup");
  made.label = label;
  made.append(...options.map(([value, text]) => new Option(text, value)));
  return made;
};

export class Choices {
  /** @param form whose fields are filled here; `games` are all games by name */
  constructor(form, { agents, anywhere, chosen }, games) {
    Object.assign(this, { form, agents, anywhere, chosen, games });
    const difficulties = Object.entries(DIFFICULTIES).map(([name, { words }]) => [name, words]);
    this.#field("difficulty").replaceChildren(group("how hard", difficulties));
    this.#offerGames();
    this.#offerSizes([1, 1]);
    form.addEventListener("change", ({ target }) => ["game", "robots"].includes(target.name) && this.refit());
  }

  #field(name) {
    return this.form.elements.namedItem(name);
  }

  /** The chosen numbers of robots: [3, 1]. */
  get #counts() {
    return this.#field("robots").value.split(" v ").map(Number);
  }

  /** Offer numbers of robots, and choose one; a game that comes as one of teams has its own. */
  #offerSizes(wanted) {
    const game = this.games[this.#field("game").value];
    const isUsual = SIZES.some((size) => size.join() === wanted.join());
    const sizes = game.teams ? [countsOf(game)] : isUsual ? SIZES : [...SIZES, wanted];
    const names = sizes.map((size) => size.join(" v "));
    this.#field("robots").replaceChildren(...names.map((name) => new Option(name, name)));
    this.#field("robots").value = game.teams ? names[0] : wanted.join(" v ");
  }

  #offerGames() {
    this.#field("game").replaceChildren(group("arenas", Object.keys(this.games).map((name) => [name, name])));
  }

  /** Add a game, or put another in its place, and choose it. */
  addGame(name, game) {
    this.games = { ...this.games, [name]: game };
    this.#offerGames();
    this.#field("game").value = name;
    this.refit();
  }

  /** Offer the players that fit the chosen game; an agent that knows only another arena is replaced. */
  refit() {
    const name = this.#field("game").value;
    this.#offerSizes(this.#counts);
    const counts = this.#counts;
    for (const role of ROLES) {
      const field = this.#field(role);
      const before = this.#asTeam(role, field.value);
      const trained = (knows) => this.agents[role].filter((agent) => this.anywhere.includes(agent) === knows);
      const asOptions = (names) => names.map((one) => [one, inWords(one)]);
      const rules = ruleNames(role, this.games[name], counts);
      const people = this.#hasMates(role) ? [...trained(true), ...rules].map(leading) : [YOU];
      field.replaceChildren(
        group("", asOptions(people)),
        group("knows any arena", asOptions(trained(true))),
        group("rules of thumb", asOptions(rules)),
        group("trained in one arena", asOptions(trained(false))),
      );
      field.value = before;
      const isAbroad = trained(false).includes(field.value) && !AT_HOME.includes(name) && this.isOurs(field.value);
      if (!field.value || isAbroad) field.value = this.agents[role].includes(ANYWHERE[role]) ? ANYWHERE[role] : "still";
    }
  }

  #hasMates(role) {
    return this.#counts[ROLES.indexOf(role)] > 1;
  }

  /** A side's name as its number of robots asks for it: a person who has mates says whom. */
  #asTeam(role, name) {
    if (!isPerson(name)) return name;
    const known = this.agents[role].includes(MATES[role]) ? MATES[role] : "still";
    return leading(this.#hasMates(role) ? (leadAndMates(name)[1] ?? known) : null);
  }

  /** Return whether an agent is of the zoo, and so was trained in the paper's arena. */
  isOurs(name) {
    return /^[PE]_\w+$/.test(name);
  }

  /** Fill the form by names and values. What there is not stays as it is; returns the names of these fields. */
  fill(values) {
    const wanted = { ...this.chosen, ...values };
    const [arena, counts] = partsOf(String(wanted.game), this.games);
    const isFew = !counts || counts.every((count) => count >= 1 && count <= MOST_ROBOTS);
    const known = { game: this.#set("game", arena) && isFew };
    this.#offerSizes((isFew && counts) || [1, 1]);
    this.refit();
    for (const role of ROLES) known[role] = this.#set(role, this.#asTeam(role, bare(String(wanted[role]))));
    for (const name of ["difficulty", "seed"]) known[name] = this.#set(name, wanted[name]);
    this.#field("shield").checked = ROLES.some((role) => String(wanted[role]).includes(SHIELDED));
    return Object.keys(known).filter((name) => !known[name]);
  }

  /** Set a field, if it takes the value; returns whether it does. */
  #set(name, value) {
    const field = this.#field(name);
    const before = field.value;
    field.value = value;
    const isTaken = field.value !== "" && field.checkValidity();
    if (!isTaken) field.value = before;
    return isTaken;
  }

  /** Read the form: {pursuer, evader, game, difficulty, seed, level}, agents with `shielded:` if it is checked. */
  read() {
    const said = Object.fromEntries(new FormData(this.form));
    const guarded = (name) => (said.shield && name ? SHIELDED + name : name);
    const named = (name) => (isPerson(name) ? leading(guarded(leadAndMates(name)[1])) : guarded(name));
    const { difficulty, seed } = said;
    const game = this.games[said.game].teams ? said.game : teamName(said.game, this.#counts);
    return { pursuer: named(said.pursuer), evader: named(said.evader), game, difficulty, seed: Number(seed), level: null };
  }

  /**
   * What an address asks for: a level, or what the form then says; and what is wrong with the address, or null.
   *
   * @param linked the game that a link brings, if one does
   */
  fromAddress(query, linked = null) {
    const values = Object.fromEntries(new URLSearchParams(query));
    const level = levelOf(values.level ?? (query || linked ? null : this.chosen.level));
    const [, counts] = partsOf(values.game ?? "", this.games);
    const missing = this.fill(linked ? { ...values, game: counts ? teamName(linked, counts) : linked } : values);
    if (linked && !query) this.refit(); // nobody is asked for who knows another arena only
    if ("level" in values && !level) missing.unshift("level");
    const name = missing.find((one) => one in values);
    const said = name ? `There is no ${name} "${values[name].slice(0, 60)}": Start plays another game, or choose under Games.` : null;
    return [level ? asChoice(level) : this.read(), said];
  }
}

/** A level as what the form would say. */
export function asChoice(level) {
  const players = { [level.side]: leading(level.mates && SHIELDED + level.mates), [other(level.side)]: SHIELDED + level.against };
  return { ...players, game: level.game, difficulty: level.difficulty, seed: level.number, level };
}

/** Return a choice as the query of an address. */
export function asQuery({ level, ...choice }) {
  return `?${new URLSearchParams(level ? { level: level.number } : choice)}`;
}

/** Buttons for all levels, with what has been reached in each. */
export function levelButtons(current, onChoice) {
  return LEVELS.map((level) => {
    const [item, button, about] = ["li", "button", "small"].map((kind) => document.createElement(kind));
    const best = bestOf(level.key);
    const told = best ? `${best.isWon ? "✓ won" : "best"}, ${best.seconds.toFixed(1)} s` : "not yet played";
    button.textContent = `${level.number}. ${level.name}`;
    about.textContent = `${level.side === EVADER ? "flee" : "hunt"}, ${level.difficulty === "told" ? "it knows you" : level.difficulty}; ${told}`;
    button.append(about);
    if (level === current) button.setAttribute("aria-current", "true");
    button.addEventListener("click", () => onChoice(level));
    item.append(button);
    return item;
  });
}
