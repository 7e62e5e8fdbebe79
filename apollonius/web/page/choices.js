// What a person may choose, in the menu and in the page's address: a level, or who plays either side, an arena, how many
// robots, how hard, a seed.

import { MOST_ROBOTS } from "./calls.js";
import { drawGround, drawRobots, scaled } from "./draw.js";
import { make } from "./files.js";
import { EVADER, ROLES, countsOf, inTeams, other, partsOf, teamName } from "./game.js";
import { LEVELS, bestOf, canBeEndless, endless, ofLevel, startOf } from "./levels.js";
import { ANYWHERE, DIFFICULTIES, ruleNames } from "./players.js";
import { drawStart, makeRandom, withMovers } from "./starts.js";
import { SHIELDED, YOU, bare, inWords } from "./words.js";

const AT_HOME = ["paper", "zero-sum"]; // games in the arena that most agents were trained in
const PICTURE = 96; // side of a level's [pixels]
const SIZES = [[1, 1], [2, 1], [3, 1], [3, 2]]; // pursuers and evaders

const asOptions = (names) => names.map((name) => new Option(name === YOU ? inWords(name) : `${inWords(name)} (${name})`, name));

export class Choices {
  /** @param form whose fields are filled here; `games` are all games by name, and more may come */
  constructor(form, { agents, anywhere, chosen, games }) {
    Object.assign(this, { form, agents, anywhere, chosen, games });
    const difficulties = Object.entries(DIFFICULTIES).map(([name, { words }]) => new Option(words, name));
    this.#field("difficulty").replaceChildren(...difficulties);
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
    const sizes = (game.teams ? [countsOf(game)] : [...SIZES, wanted]).map((size) => size.join(" v "));
    this.#field("robots").replaceChildren(...[...new Set(sizes)].map((name) => new Option(name, name)));
    this.#field("robots").value = sizes.at(-1);
  }

  #offerGames() {
    this.#field("game").replaceChildren(...Object.keys(this.games).map((name) => new Option(name, name)));
  }

  /** Choose a game that is new among the games, or not as it was. */
  chooseGame(name) {
    this.#offerGames();
    this.#field("game").value = name;
    this.refit();
  }

  /** Offer the players that fit the chosen game; an agent of the zoo that knows only another arena is replaced. */
  refit() {
    const name = this.#field("game").value;
    this.#offerSizes(this.#counts);
    for (const role of ROLES) {
      const field = this.#field(role);
      const before = field.value;
      const trained = (knows) => this.agents[role].filter((agent) => this.anywhere.includes(agent) === knows);
      field.replaceChildren(
        ...asOptions([YOU]),
        make("optgroup", { label: "trained in many arenas" }, ...asOptions(trained(true))),
        make("optgroup", { label: "rules of thumb" }, ...asOptions(ruleNames(role, this.games[name], this.#counts))),
        make("optgroup", { label: "trained in one arena" }, ...asOptions(trained(false))),
      );
      field.value = before;
      const isAbroad = trained(false).includes(field.value) && !AT_HOME.includes(name) && /^[PE]_\w+$/.test(field.value);
      if (!field.value || isAbroad) field.value = ANYWHERE[role];
    }
  }

  /** Fill the form by names and values. What there is not stays as it is; returns the names of these fields. */
  fill(values) {
    const wanted = { ...this.chosen, ...values };
    const [arena, counts] = partsOf(String(wanted.game), this.games);
    const isFew = !counts || counts.every((count) => count >= 1 && count <= MOST_ROBOTS);
    const known = { game: this.#set("game", arena) && isFew };
    this.#offerSizes((isFew && counts) || [1, 1]);
    this.refit();
    for (const role of ROLES) known[role] = this.#set(role, bare(String(wanted[role])));
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
    const { pursuer, evader, shield, difficulty, seed, ...said } = Object.fromEntries(new FormData(this.form));
    const named = (name) => (shield && name !== YOU ? SHIELDED + name : name);
    const game = this.games[said.game].teams ? said.game : teamName(said.game, this.#counts);
    return { pursuer: named(pursuer), evader: named(evader), game, difficulty, seed: Number(seed), level: null };
  }

  /**
   * What an address asks for: a level, or what the form then says; and what is wrong with the address, or null.
   *
   * @param linked the game that a link brings, if one does
   */
  fromAddress(query, linked = null) {
    const values = Object.fromEntries(new URLSearchParams(query));
    const level = LEVELS[(values.level ?? (query || linked ? null : this.chosen.level)) - 1] ?? null;
    const [, counts] = partsOf(values.game ?? "", this.games);
    const missing = this.fill(linked ? { ...values, game: counts ? teamName(linked, counts) : linked } : values);
    if (linked && !query) this.refit(); // nobody is asked for who knows another arena only
    if ("level" in values && !level) missing.unshift("level");
    const name = missing.find((one) => one in values);
    const said = name ? `There is no ${name} "${values[name].slice(0, 60)}": Start plays another game, or choose under Games.` : null;
    return [level ? asChoice(values.endless && canBeEndless(level) ? endless(level) : level) : this.read(), said];
  }
}

/** A level as what the form would say. */
export function asChoice(level) {
  const players = level.isLesson ? {} : { [level.side]: YOU, [other(level.side)]: SHIELDED + level.against };
  return { ...players, game: level.game, difficulty: level.difficulty, seed: level.seed, level };
}

/** Return a choice as the query of an address. */
export function asQuery({ level, ...choice }) {
  return `?${new URLSearchParams(level ? { level: level.number, ...(level.isEndless && { endless: 1 }) } : choice)}`;
}

const SIGN = 2.5; // times larger than in the arena

/** The arena of a level, with its robots where they start. */
function drawLevel(canvas, games, level, colours) {
  const [name, counts] = partsOf(level.game, games);
  const game = ofLevel(counts ? inTeams(games[name], ...counts) : games[name], level);
  const context = scaled(canvas, game.arena);
  drawGround(context, game.arena, colours);
  const random = makeRandom(level.seed);
  const start = startOf(game, level) ?? drawStart(game, random);
  drawRobots(context, game, withMovers(game, start, random), colours, SIGN);
}

/** How many levels a person has won, in words. */
export function describeProgress() {
  const playable = LEVELS.filter(({ side }) => side);
  const won = playable.filter((level) => bestOf(level) !== null).length;
  return won ? `Levels: ${won} of ${playable.length} won` : "Levels";
}

/** A small button for each level, by its number; a star where it is won. */
export function levelStrip(current, onChoice) {
  return LEVELS.map((level) => {
    const isWon = bestOf(level) !== null;
    const title = `${level.number}. ${level.name}${isWon ? ", won" : ""}`;
    const button = make("button", { title, ariaLabel: title, onclick: () => onChoice(level) }, isWon ? "★" : `${level.number}`);
    if (level.number === current?.number) button.setAttribute("aria-current", "true");
    return button;
  });
}

/** Buttons for all levels, with their arenas and what has been reached in each. */
export function levelButtons(games, colours, current, onChoice) {
  return LEVELS.map((level) => {
    const picture = make("canvas", { width: PICTURE, height: PICTURE, ariaHidden: "true" });
    drawLevel(picture, games, level, colours);
    const best = bestOf(level);
    const isFlight = level.side === EVADER;
    const reached = best === null ? "" : `; ★ won${isFlight ? "" : `, ${best.toFixed(1)} s`}`;
    const about = make("small", {}, level.isLesson ? "six reds of one training" : `${isFlight ? "flee" : "hunt"}, ${level.difficulty}${reached}`);
    const button = make("button", { onclick: () => onChoice(level) }, picture, `${level.number}. ${level.name}`, about);
    if (level === current) button.setAttribute("aria-current", "true");
    const longest = bestOf(endless(level));
    const ever = `Endless${longest === null ? "" : `: ${longest.toFixed(1)} s so far`}`;
    const more = canBeEndless(level) && best !== null ? [make("button", { onclick: () => onChoice(endless(level)) }, ever)] : [];
    return make("li", {}, button, ...more);
  });
}
