// What a person may choose, in the menu and in the page's address: a level, or two players, an arena, how hard, a seed.

import { bestOf } from "./best.js";
import { DIFFICULTIES } from "./difficulty.js";
import { LEVELS, levelOf } from "./levels.js";
import { SHIELDED, YOU, bare, inWords } from "./names.js";
import { ruleNames } from "./players.js";
import { EVADER, PURSUER, other } from "./rules.js";

const ROLES = [PURSUER, EVADER];
const AT_HOME = ["paper", "zero-sum"]; // games in the arena that most agents were trained in
const ANYWHERE = { [PURSUER]: "P_any", [EVADER]: "E_any" };

const group = (label, options) => {
  const made = document.createElement("optgroup");
  made.label = label;
  made.append(...options.map(([value, text]) => new Option(text, value)));
  return made;
};

export class Choices {
  /** @param form whose fields are filled here; `games` are all that there are by name */
  constructor(form, { agents, anywhere, chosen }, games) {
    Object.assign(this, { form, agents, anywhere, chosen, games });
    const difficulties = Object.entries(DIFFICULTIES).map(([name, { words }]) => [name, words]);
    this.#field("difficulty").replaceChildren(group("how hard", difficulties));
    this.#offerGames();
    form.addEventListener("change", ({ target }) => target.name === "game" && this.refit());
  }

  #field(name) {
    return this.form.elements.namedItem(name);
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

  /** Offer the players that fit the chosen game; who knows only one arena makes room for one who knows any. */
  refit() {
    const name = this.#field("game").value;
    for (const role of ROLES) {
      const field = this.#field(role);
      const before = field.value;
      const trained = (knows) => this.agents[role].filter((agent) => this.anywhere.includes(agent) === knows);
      const asOptions = (names) => names.map((one) => [one, inWords(one)]);
      field.replaceChildren(
        group("", asOptions([YOU])),
        group("knows any arena", asOptions(trained(true))),
        group("rules of thumb", asOptions(ruleNames(role, this.games[name]))),
        group("trained in one arena", asOptions(trained(false))),
      );
      field.value = before;
      const isAbroad = trained(false).includes(field.value) && !AT_HOME.includes(name) && this.isOurs(field.value);
      if (!field.value || isAbroad) field.value = this.agents[role].includes(ANYWHERE[role]) ? ANYWHERE[role] : "still";
    }
  }

  /** Whether an agent is one of the zoo, which were trained in the paper's arena. */
  isOurs(name) {
    return /^[PE]_\w+$/.test(name);
  }

  /** Fill the form by names and values; what there is not is left as it was at the beginning. */
  fill(values) {
    const wanted = { ...this.chosen, ...values };
    this.#set("game", wanted.game);
    this.refit();
    for (const role of ROLES) this.#set(role, bare(String(wanted[role])));
    for (const name of ["difficulty", "seed"]) this.#set(name, wanted[name]);
    this.#field("shield").checked = ROLES.some((role) => String(wanted[role]).startsWith(SHIELDED));
  }

  #set(name, value) {
    const field = this.#field(name);
    field.value = value;
    if (!field.value) field.value = bare(String(this.chosen[name]));
  }

  /** What the form says: {pursuer, evader, game, difficulty, seed, level}, agents with `shielded:` where wanted. */
  read() {
    const said = Object.fromEntries(new FormData(this.form));
    const named = (name) => (said.shield && name !== YOU ? SHIELDED + name : name);
    const { game, difficulty, seed } = said;
    return { pursuer: named(said.pursuer), evader: named(said.evader), game, difficulty, seed: Number(seed), level: null };
  }

  /** What an address asks for: a level, or what the form then says. `linked` is the game that a link brings, if one does. */
  fromAddress(query, linked = null) {
    const values = Object.fromEntries(new URLSearchParams(query));
    const number = values.level ?? (query || linked ? null : this.chosen.level);
    this.fill(linked ? { ...values, game: linked } : values);
    if (linked && !query) this.refit(); // nobody is asked for who knows another arena only
    const level = levelOf(number);
    return level ? asChoice(level) : this.read();
  }
}

/** A level as what the form would say. */
export function asChoice(level) {
  const players = { [level.side]: YOU, [other(level.side)]: SHIELDED + level.against };
  return { ...players, game: level.game, difficulty: level.difficulty, seed: level.number, level };
}

/** The same as the query of an address. */
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
