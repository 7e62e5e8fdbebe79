// Where arenas are drawn: tools, sliders, files and links around the editor, and the way to the game and back.

import { Editor, TOOLS } from "./editor.js";
import { copyLink, make, saveAs } from "./files.js";
import { DEFAULT, asFragment, fromFragment, gameFrom, readGame } from "./gamefile.js";
import { cleared, withSize } from "./plan.js";
import { survey } from "./survey.js";

const MARK = "#game="; // before a game in a link
const DRAWN = "drawn"; // what the arena of this page's person is called among the games
const HINTS = {
  select: "Drag to move, drag a dot to resize.",
  disc: "Drag from its centre, or tap.",
  wall: "Drag along it, or tap; leave a gap for a door.",
  block: "Drag from corner to corner, or tap.",
};
const LIMITS = { v_max: [0.2, 3, "top speed, m/s"], u1_max: [0.1, 2, "acceleration, m/s²"], u2_max: [0.1, 3, "turn rate, rad/s"], radius: [0, 0.5, "radius, m"] };
const STEP = 0.05;
const LARGEST_FILE = 1_000_000; // bytes

export class Workshop {
  /**
   * @param element finds a part of the page by its id
   * @param session that is interrupted, and whose catalogue gets the drawn game
   * @param choices offer it
   */
  constructor(element, session, choices) {
    Object.assign(this, { element, session, choices });
    this.editor = new Editor(element("canvas"), (game) => this.#changed(game));
    this.#makeTools();
    this.#makeSliders();
    this.#wire();
  }

  /** The game as it is drawn; throws an Error in one line where it cannot be played. */
  get game() {
    const { map, ...arena } = this.editor.game.arena;
    return gameFrom({ ...this.editor.game, arena }, map ?? null);
  }

  /** Open the workshop with the arena of the game that is played. */
  open() {
    this.session.enter("drawing");
    const { teams: _teams, sensors: _sensors, ...game } = this.session.match?.game ?? this.session.catalogue.games.paper; // of two
    this.editor.open({ ...game, arena: { ...game.arena, polygons: game.arena.polygons ?? [] } });
  }

  /** Open the game that a person has chosen or dropped. Says what is wrong with it if it is. */
  async openFile(file) {
    if (!this.editor.game) this.open();
    this.session.enter("drawing");
    await this.#trying(async () => {
      const { name, size } = file;
      if (name.endsWith(".toml")) throw new Error(`this page reads JSON, which apollonius arena check ${name} --out ${name.slice(0, -5)}.json writes`);
      if (!name.endsWith(".json")) throw new Error(`${name.slice(0, 60)} is not a game (.json)`);
      if (size > LARGEST_FILE) throw new Error(`${name} is too large: ${Math.round(size / 1e6)} MB`);
      this.editor.open(readGame(await file.text()));
    });
  }

  /** Play in the arena as it is drawn, with players that know any. */
  play() {
    this.#offer(this.game);
    this.session.begin(this.choices.read());
  }

  /** Put a drawn game among the others, and choose it. */
  #offer(game) {
    this.session.catalogue.games[DRAWN] = game;
    this.choices.chooseGame(DRAWN);
  }

  /** Offer the game of a link's fragment, if it has one; returns its name, or null, and what is wrong with it, or null. */
  async offerLinked(fragment) {
    try {
      const text = await fromFragment(MARK, fragment);
      if (text !== null) this.#offer(readGame(text));
      return [text !== null ? DRAWN : null, null];
    } catch (error) {
      return [null, `The arena in this link cannot be played: ${error.message}.`];
    }
  }

  // ---- what is said of the arena

  #changed(game) {
    const { element } = this;
    for (const show of this.sliders) show(game);
    element("undo").disabled = !this.editor.past.length;
    let isPlayable = true;
    let wrong;
    try {
      wrong = survey(this.game);
    } catch (error) {
      [isPlayable, wrong] = [false, `${error.message}.`];
    }
    element("findings").textContent = wrong ? `✗ ${wrong}` : "✓ Nothing is wrong with this arena.";
    element("play-here").disabled = !isPlayable;
  }

  #say(text) {
    this.element("said").textContent = text;
  }

  async #trying(action) {
    try {
      await action();
    } catch (error) {
      this.#say(`${error.message}.`);
    }
  }

  // ---- tools and sliders

  #makeTools() {
    const buttons = TOOLS.map((tool) => {
      const onclick = ({ detail }) => {
        this.#choose(tool);
        if (detail === 0) this.editor.useInTheMiddle(tool); // by the keyboard
      };
      return make("button", { value: tool, title: HINTS[tool], onclick }, tool);
    });
    this.element("tools").prepend(...buttons);
    this.#choose("block");
  }

  #choose(tool) {
    this.editor.tool = tool;
    if (tool !== "select") this.editor.selected = null;
    for (const button of this.element("tools").querySelectorAll("[value]")) button.setAttribute("aria-pressed", button.value === tool);
    this.#say(HINTS[tool]);
  }

  #makeSliders() {
    this.sliders = [];
    const add = (place, text, [least, most, step], get, set) => {
      const [value, input] = [make("span"), make("input", { type: "range", min: least, max: most, step })];
      input.onchange = () => this.editor.change(set(this.editor.game, Number(input.value)));
      input.oninput = () => (value.textContent = input.value);
      this.element(place).append(make("label", {}, `${text} `, value, input));
      this.sliders.push((game) => {
        input.value = get(game);
        value.textContent = Number(get(game).toFixed(3));
        input.disabled = place === "size" && Boolean(game.arena.map);
      });
    };
    const length = (axis) => ({ arena }) => arena[`${axis}_max`] - arena[`${axis}_min`];
    add("size", "width, m", [2, 40, 0.5], length("x"), (game, value) => withSize(game, value, length("y")(game)));
    add("size", "height, m", [2, 40, 0.5], length("y"), (game, value) => withSize(game, length("x")(game), value));
    add("rules", "capture distance, m", [0.1, 1.5, STEP], (game) => game.capture_distance, (game, value) => {
      const starts = { ...game.starts, separation: Math.max(game.starts.separation, value) };
      return { ...game, capture_distance: value, starts };
    });
    add("rules", "time limit, s", [10, 300, 10], (game) => game.max_steps * game.dt, (game, value) => ({ ...game, max_steps: Math.round(value / game.dt) }));
    for (const side of ["pursuer", "evader"]) {
      for (const [name, [least, most, text]] of Object.entries(LIMITS)) {
        add(side === "pursuer" ? "red" : "blue", text, [least, most, STEP], (game) => game[side][name], (game, value) => {
          return { ...game, [side]: { ...game[side], [name]: value } };
        });
      }
    }
  }

  // ---- files and links

  #wire() {
    const { element, editor } = this;
    const on = (id, action) => element(id).addEventListener("click", action);
    on("undo", () => editor.undo());
    on("remove", () => editor.remove());
    on("clear", () => editor.change(editor.game.arena.map ? DEFAULT : cleared(editor.game)));
    on("save", () => this.#trying(() => this.#save()));
    on("share", () => this.#trying(() => this.#share()));
    on("open", () => element("file").click());
    element("file").addEventListener("change", async ({ target }) => {
      await this.openFile(target.files[0]);
      target.value = "";
    });
    for (const type of ["dragover", "drop"]) document.addEventListener(type, (event) => event.preventDefault());
    document.addEventListener("drop", ({ dataTransfer }) => dataTransfer?.files.length && this.openFile(dataTransfer.files[0]));
  }

  #save() {
    const { game } = this;
    const written = { ...game, arena: { ...game.arena, map: game.arena.map?.file } }; // the YAML file, which lies beside it
    saveAs("arena.json", JSON.stringify(written, null, 2), "application/json");
    this.#say("Saved. apollonius play --game arena.json plays it, apollonius train --game arena.json trains for it.");
  }

  async #share() {
    const { game } = this;
    if (game.arena.map) throw new Error("a map is too large for a link: save the game and send its files");
    await copyLink(location.href.split(/[?#]/)[0] + (await asFragment(MARK, JSON.stringify(game))));
    this.#say("The link to this arena is copied, and in the address bar.");
  }
}
