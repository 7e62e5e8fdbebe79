// Where arenas are drawn: tools, sliders, files and links around the editor, and what `arena check` says of them.

import { Editor, TOOLS } from "./editor.js";
import { saveAs } from "./files.js";
import { asFragment, readGame, writeGame } from "./gamefile.js";
import { mapOf, mapOfPicture, readYaml } from "./mapfile.js";
import { cleared, withSize } from "./plan.js";
import { Surveying } from "./surveying.js";
import { DEFAULT, gameFrom } from "./validation.js";

const HINTS = {
  select: "Drag to move, drag a dot to resize.",
  disc: "Drag from its middle, or tap.",
  wall: "Drag along it, or tap.",
  block: "Drag from corner to corner, or tap.",
  room: "Drag from corner to corner: walls with a door.",
  corridor: "Drag along it: two walls.",
  door: "Tap a straight wall.",
  erase: "Tap what is to go.",
};
const LIMITS = { v_max: [0.2, 3, "top speed, m/s"], u1_max: [0.1, 2, "acceleration, m/s²"], u2_max: [0.1, 3, "turn rate, rad/s"], radius: [0, 0.5, "radius, m"] };
const STEP = 0.05;
const LARGEST_FILE = 40_000_000; // bytes

export class Workshop {
  /** @param element finds a part of the page by its id */
  constructor(element) {
    this.element = element;
    this.editor = new Editor(element("canvas"), (game) => this.#changed(game));
    this.surveying = new Surveying((found) => this.#hear(found));
    Object.assign(this, { found: null, checked: null, problem: null, files: [] });
    this.#makeTools();
    this.#makeSliders();
    this.#wire();
  }

  /** The game as it is drawn; throws an Error in one line where it cannot be played. */
  get game() {
    if (this.problem) throw this.problem;
    return this.checked;
  }

  open(game, files = []) {
    const { record: _record, ...own } = game;
    this.files = files;
    this.editor.open({ ...own, arena: { ...own.arena, polygons: own.arena.polygons ?? [] } });
  }

  /** Open what a person has chosen or dropped: a game, a map, a picture. Says what is wrong with it if it is. */
  async openFiles(list) {
    try {
      const large = [...list].find(({ size }) => size > LARGEST_FILE);
      if (large) throw new Error(`${large.name} is too large: ${Math.round(large.size / 1e6)} MB`);
      const files = await Promise.all([...list].map(async (file) => ({ name: file.name, bytes: new Uint8Array(await file.arrayBuffer()) })));
      const [game, own] = await opened(files);
      this.open(game, own);
    } catch (error) {
      this.#say(`${error.message}.`);
    }
  }

  key(event) {
    return this.editor.key(event);
  }

  draw(colours) {
    this.editor.draw(colours, this.found);
  }

  // ---- what is said of the arena

  #changed(game) {
    const { element } = this;
    const { map, ...arena } = game.arena;
    [this.found, this.problem, this.checked] = [null, null, null];
    this.#show(game);
    try {
      this.checked = gameFrom({ ...game, arena }, map ?? null);
      this.#list(["Looking…"]);
    } catch (error) {
      this.problem = error;
      this.#list([`✗ ${error.message}.`]);
    }
    this.surveying.ask(this.checked);
    element("play-here").disabled = this.problem !== null;
  }

  #hear(found) {
    this.found = found;
    const lines = [...found.wrong.map((line) => `✗ ${line}`), ...found.notes.map((line) => `· ${line}`)];
    this.#list(found.wrong.length ? lines : ["✓ Nothing is wrong with this arena.", ...lines]);
  }

  #list(lines) {
    const items = lines.map((line) => Object.assign(document.createElement("li"), { textContent: line }));
    this.element("findings").replaceChildren(...items);
  }

  #say(text) {
    this.element("said").textContent = text;
  }

  // ---- tools and sliders

  #makeTools() {
    const buttons = TOOLS.map((tool) => {
      const button = Object.assign(document.createElement("button"), { textContent: tool, title: HINTS[tool] });
      button.dataset.tool = tool;
      button.addEventListener("click", ({ detail }) => {
        this.#choose(tool);
        if (detail === 0) this.editor.useInTheMiddle(tool); // by the keyboard
      });
      return button;
    });
    this.element("tools").prepend(...buttons);
    this.#choose("block");
  }

  #choose(tool) {
    this.editor.tool = tool;
    if (tool !== "select") this.editor.selected = null;
    for (const button of this.element("tools").querySelectorAll("[data-tool]")) {
      button.setAttribute("aria-pressed", String(button.dataset.tool === tool));
    }
    this.#say(HINTS[tool]);
  }

  #makeSliders() {
    this.sliders = [];
    const add = (place, text, [least, most, step], get, set) => {
      const [label, value, input] = ["label", "span", "input"].map((kind) => document.createElement(kind));
      Object.assign(input, { type: "range", min: least, max: most, step });
      input.addEventListener("change", () => this.editor.change(set(this.editor.game, Number(input.value))));
      input.addEventListener("input", () => (value.textContent = input.value));
      label.append(`${text} `, value, input);
      this.element(place).append(label);
      this.sliders.push((game) => {
        input.value = get(game);
        value.textContent = Number(get(game).toFixed(3));
        input.disabled = place === "size" && Boolean(game.arena.map);
      });
    };
    const length = (axis) => ({ arena }) => arena[`${axis}_max`] - arena[`${axis}_min`];
    add("size", "width, m", [2, 40, 0.5], length("x"), (game, value) => withSize(game, value, length("y")(game)));
    add("size", "height, m", [2, 40, 0.5], length("y"), (game, value) => withSize(game, length("x")(game), value));
    add("rules", "caught at, m", [0.1, 1.5, STEP], (game) => game.capture_distance, (game, value) => {
      const starts = { ...game.starts, separation: Math.max(game.starts.separation, value) };
      return { ...game, capture_distance: value, starts };
    });
    add("rules", "lasts, s", [10, 300, 10], (game) => game.max_steps * game.dt, (game, value) => ({ ...game, max_steps: Math.round(value / game.dt) }));
    for (const side of ["pursuer", "evader"]) {
      for (const [name, [least, most, text]] of Object.entries(LIMITS)) {
        add(side === "pursuer" ? "red" : "blue", text, [least, most, STEP], (game) => game[side][name], (game, value) => {
          return { ...game, [side]: { ...game[side], [name]: value } };
        });
      }
    }
  }

  #show(game) {
    for (const show of this.sliders) show(game);
    this.element("undo").disabled = !this.editor.past.length;
    this.element("redo").disabled = !this.editor.future.length;
  }

  // ---- files and links

  #wire() {
    const { element, editor } = this;
    const on = (id, action) => element(id).addEventListener("click", action);
    on("undo", () => editor.undo());
    on("redo", () => editor.redo());
    on("remove", () => editor.remove());
    on("clear", () => editor.change(editor.game.arena.map ? DEFAULT : cleared(editor.game)));
    on("save", () => this.#trying(() => this.#save()));
    on("share", () => this.#trying(() => this.#share()));
    on("open", () => element("file").click());
    element("file").addEventListener("change", async ({ target }) => {
      await this.openFiles(target.files);
      target.value = "";
    });
  }

  async #trying(action) {
    try {
      await action();
    } catch (error) {
      this.#say(`${error.message}.`);
    }
  }

  #save() {
    saveAs("arena.json", writeGame(this.game), "application/json");
    const { map } = this.game.arena;
    const isShown = this.files.some(({ name }) => name === map?.file);
    if (isShown) for (const { name, bytes } of this.files) saveAs(name, bytes, "application/octet-stream");
    this.#say("Saved: apollonius play --game arena.json plays it, apollonius train --game arena.json learns it.");
  }

  async #share() {
    const link = new URL(asFragment(this.game), location.href.split("#")[0].split("?")[0]).href;
    history.replaceState(null, "", new URL(link).hash);
    await navigator.clipboard?.writeText(link).catch(() => null);
    this.#say("The link to this arena is copied, and stands in the address.");
  }
}

/** The game of some files, and those that are to be saved with it. */
async function opened(files) {
  const ending = (...endings) => files.find(({ name }) => endings.some((one) => name.toLowerCase().endsWith(one)));
  const toml = ending(".toml")?.name.slice(0, 60);
  if (toml) throw new Error(`${toml} is TOML and this page reads JSON, which apollonius arena check ${toml} --out ${toml.slice(0, -5)}.json writes`);
  const [json, yaml, image] = [ending(".json"), ending(".yaml", ".yml"), ending(".pgm", ".png", ".jpg", ".jpeg", ".webp", ".gif")];
  if (yaml) {
    const { image: named } = readYaml(new TextDecoder().decode(yaml.bytes));
    const found = files.find(({ name }) => name === named.split("/").pop()) ?? image;
    if (!found) throw new Error(`the map names the image ${named.slice(0, 60)}: drop both files together`);
    const map = await mapOf(yaml, found);
    const text = json ? new TextDecoder().decode(json.bytes) : "{}";
    return [readGame(text, map), [yaml, found]];
  }
  if (json) return [readGame(new TextDecoder().decode(json.bytes)), []];
  if (!image) throw new Error("this is no game (.json), no ROS map (.yaml and its image) and no picture");
  const { map, files: own } = await mapOfPicture(image);
  return [gameFrom({}, map), own];
}
