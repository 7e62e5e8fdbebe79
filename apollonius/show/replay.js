// Plays the recorded games of a report, drawn by the modules of the web page. A game is the data of a replay file; its states
// are rows of x, y [m], v [m/s], heading [rad] of each pursuer, then of each evader. Of a game of teams there is `until` too:
// for each robot the first step at which it is out of play, or null.

import { coloursOf, draw } from "../web/page/draw.js";
import { fromRow } from "../web/page/game.js";

/** The states of a game as the page has them. */
export function statesOf({ game, states, until }) {
  const status = (steps) => (place) => (steps < (until?.[place] ?? Infinity) ? "active" : "out");
  return states.map((row, steps) => fromRow(game, row, steps, status(steps)));
}

/**
 * Plays games in the elements of a page. Inside `root` it looks for `canvas`, and by `data-part` for `play` and `pace`
 * (a button and a select: simulated seconds in a second), `seek` (a range), `clock` and `outcome` (for text),
 * and for elements with `data-game`, each of which chooses the game of that index.
 */
export class ReplayPlayer {
  constructor(root, replays) {
    this.root = root;
    this.replays = replays;
    this.canvas = root.querySelector("canvas");
    this.part = (name) => root.querySelector(`[data-part="${name}"]`);
    this.part("play").addEventListener("click", () => (this.playing ? this.pause() : this.play()));
    this.part("seek").addEventListener("input", (event) => {
      this.pause();
      this.show(Number(event.target.value));
    });
    this.choices = [...root.querySelectorAll("[data-game]")];
    for (const choice of this.choices) {
      choice.addEventListener("click", () => {
        this.choose(Number(choice.dataset.game));
        this.canvas.scrollIntoView({ block: "nearest" });
        this.play();
      });
    }
    new ResizeObserver(() => this.show(this.step)).observe(this.canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.show(this.step));
    this.choose(0);
  }

  /** Take up a game; it is shown at its end, with all trails. A map's cells are not in the report. */
  choose(index) {
    this.pause();
    this.replay = this.replays[index];
    const { game, pursuer, evader, outcome } = this.replay;
    const { arena, dt } = game;
    this.game = { ...game, arena: { ...arena, map: null } };
    this.states = statesOf(this.replay);
    this.last = this.states.length - 1;
    this.canvas.style.aspectRatio = `${arena.x_max - arena.x_min} / ${arena.y_max - arena.y_min}`;
    this.part("seek").max = this.last;
    this.part("outcome").textContent =
      `${pursuer} against ${evader}: ${outcome.replaceAll("_", " ")} after ${(this.last * dt).toFixed(1)} s` +
      (arena.map ? "; the occupancy map of this arena is not shown here" : "");
    for (const choice of this.choices) choice.setAttribute("aria-pressed", String(Number(choice.dataset.game) === index));
    this.show(this.last);
  }

  /** Play on from here, or from the start if the game is at its end. */
  play() {
    if (this.step >= this.last) this.show(0);
    this.playing = true;
    this.part("play").textContent = "Pause";
    let before;
    const frame = (now) => {
      if (!this.playing) return;
      const seconds = before === undefined ? 0 : (now - before) / 1000;
      before = now;
      this.show(Math.min(this.last, this.step + (seconds * Number(this.part("pace").value)) / this.game.dt));
      if (this.step >= this.last) this.pause();
      else requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  pause() {
    this.playing = false;
    this.part("play").textContent = "Play";
  }

  /** Show the game as it stands at a step, whole or not. */
  show(step) {
    this.step = step;
    draw(this.canvas, { game: this.game, states: this.states, at: step, colours: coloursOf(this.root) });
    const { dt } = this.game;
    const clock = `${(step * dt).toFixed(1)} s of ${(this.last * dt).toFixed(1)} s`;
    this.part("seek").value = Math.round(step);
    this.part("seek").setAttribute("aria-valuetext", clock);
    this.part("clock").textContent = clock;
  }
}
