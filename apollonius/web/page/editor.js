// An arena under a person's hand: tools for pointers and keys, what is selected, undo. Changes are those of `plan.js`.

import { begin, circle, drawGround, path, placing } from "./draw.js";
import { GRID, gripsOf, joined, moved, resized, snapped, withBlock, withDisc, withWall, without } from "./plan.js";

const TAP = 0.25; // a pointer that moved less [m] has tapped
const TOUCH = 18; // how near a finger hits a grip [px]
const DEPTH = 200; // changes that can be undone

/** Tools that are dragged from one point to another: what they make, and of a tap the way to either side [m]. */
const MAKES = {
  disc: { make: withDisc, tap: [[0, 0], [0.5, 0]] },
  wall: { make: withWall, tap: [[-1, 0], [1, 0]] },
  block: { make: withBlock, tap: [[-0.5, -0.5], [0.5, 0.5]] },
};
export const TOOLS = ["select", ...Object.keys(MAKES)];

export class Editor {
  /** @param onChange called after every change that stays, with the game */
  constructor(canvas, onChange) {
    Object.assign(this, { canvas, onChange, game: null, tool: "select", selected: null, gesture: null, past: [] });
    canvas.addEventListener("pointerdown", (event) => this.#down(event));
    canvas.addEventListener("pointermove", (event) => this.#move(event));
    canvas.addEventListener("pointerup", (event) => this.#up(event));
    canvas.addEventListener("pointercancel", () => this.#cancel());
  }

  /** Begin with a game; nothing of what was before can be undone. */
  open(game) {
    Object.assign(this, { game, selected: null, gesture: null, past: [] });
    this.onChange(game);
  }

  /** Another game in this one's place; it can be undone. */
  change(game) {
    if (game === this.game) return;
    this.past = [...this.past, this.game].slice(-DEPTH);
    this.game = game;
    if (this.selected && !game.arena[this.selected.kind][this.selected.index]) this.selected = null;
    this.onChange(game);
  }

  undo() {
    if (!this.past.length) return;
    Object.assign(this, { game: this.past.pop(), selected: null });
    this.onChange(this.game);
  }

  /** Remove what is selected. */
  remove() {
    const { selected } = this;
    if (!selected) return;
    this.selected = null;
    this.change(without(this.game, selected));
  }

  /** Use a tool in the middle of the arena, as who has no pointer does. */
  useInTheMiddle(tool) {
    const { x_min, x_max, y_min, y_max } = this.game.arena;
    if (tool in MAKES) this.#tap(tool, snapped([(x_min + x_max) / 2, (y_min + y_max) / 2]));
  }

  /** Hear a key; returns whether it was one of the editor's. */
  key(event) {
    const nudge = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.code];
    if (event.ctrlKey || event.metaKey) {
      if (event.code !== "KeyZ") return false;
      this.undo();
    } else if (event.code === "Delete" || event.code === "Backspace") this.remove();
    else if (event.code === "Escape") this.selected = null;
    else if (nudge && this.selected) this.change(moved(this.game, this.selected, nudge.map((way) => way * GRID)));
    else return false;
    return true;
  }

  // ---- pointers

  /** Where a pointer is: in pixels of the canvas, and in the arena; `reach` is how near it hits [m]. */
  #where(event) {
    const ratio = globalThis.devicePixelRatio;
    const { scale, x, y } = placing(this.canvas, this.game.arena);
    const box = this.canvas.getBoundingClientRect();
    const pixel = [(event.clientX - box.left) * ratio, (event.clientY - box.top) * ratio];
    return { pixel, point: [(pixel[0] - x) / scale, (y - pixel[1]) / scale], reach: (TOUCH * ratio) / scale };
  }

  /** The topmost shape at a pointer, or within half of its reach, if there is one. */
  #shapeAt({ pixel, reach }) {
    const { arena } = this.game;
    const context = this.canvas.getContext("2d"); // scaled to metres by the last drawing
    context.lineWidth = reach;
    const shapes = ["discs", "polygons"].flatMap((kind) => arena[kind].map((_, index) => ({ kind, index })));
    return shapes.findLast(({ kind, index }) => {
      outline(context, arena[kind][index]);
      return context.isPointInPath(...pixel) || context.isPointInStroke(...pixel);
    });
  }

  #down(event) {
    if (!this.game || this.gesture || document.body.dataset.phase !== "drawing") return;
    event.preventDefault();
    this.canvas.setPointerCapture(event.pointerId);
    const where = this.#where(event);
    const { point, reach } = where;
    const gesture = { base: this.game, from: point, pointer: event.pointerId };
    if (this.tool !== "select") {
      this.gesture = { ...gesture, kind: this.tool };
      return;
    }
    const grips = this.selected ? gripsOf(this.game, this.selected) : [];
    const grip = grips.findIndex(([x, y]) => Math.hypot(x - point[0], y - point[1]) <= reach);
    if (grip < 0) this.selected = this.#shapeAt(where);
    if (this.selected) this.gesture = { ...gesture, kind: grip < 0 ? "move" : "resize", grip };
  }

  #move(event) {
    const { gesture } = this;
    if (!gesture || event.pointerId !== gesture.pointer) return;
    const { base, from, kind, grip } = gesture;
    const { point } = this.#where(event);
    const way = snapped([point[0] - from[0], point[1] - from[1]]);
    if (kind === "move") this.game = moved(base, this.selected, way);
    else if (kind === "resize") this.game = resized(base, this.selected, grip, snapped(point));
    else if (kind === "disc") this.game = withDisc(base, snapped(from), snapped(point));
    else this.game = MAKES[kind].make(base, joined(base, from), joined(base, point));
  }

  #up(event) {
    const { gesture } = this;
    if (!gesture || event.pointerId !== gesture.pointer) return;
    this.#move(event);
    const { point } = this.#where(event);
    const { from, kind } = gesture;
    const drawn = this.game;
    this.#cancel();
    if (kind in MAKES && Math.hypot(point[0] - from[0], point[1] - from[1]) < TAP) this.#tap(kind, snapped(from));
    else this.#make(drawn);
  }

  #cancel() {
    if (this.gesture) this.game = this.gesture.base;
    this.gesture = null;
  }

  /** Make a shape of the usual size around a point. */
  #tap(tool, [x, y]) {
    const [from, to] = MAKES[tool].tap.map(([right, up]) => [x + right, y + up]);
    this.#make(MAKES[tool].make(this.game, from, to));
  }

  /** Change to a game, and select the shape that it has more, if it has one. */
  #make(game) {
    for (const kind of ["discs", "polygons"]) {
      const count = game.arena[kind].length;
      if (count > this.game.arena[kind].length) this.selected = { kind, index: count - 1 };
    }
    this.change(game);
  }

  // ---- drawing

  /** Draw the arena, with what is selected. */
  draw(colours) {
    const { game, selected } = this;
    const context = begin(this.canvas, game.arena);
    drawGround(context, game.arena, colours);
    const shape = selected && game.arena[selected.kind][selected.index];
    if (!shape) return;
    const pixel = globalThis.devicePixelRatio / placing(this.canvas, game.arena).scale; // [m]
    context.lineWidth = 2 * pixel;
    context.strokeStyle = context.fillStyle = colours.evader;
    outline(context, shape).stroke();
    for (const [x, y] of gripsOf(game, selected)) circle(context, x, y, 6 * pixel).fill();
  }
}

/** The outline of a disc or a polygon. */
function outline(context, { x, y, radius, vertices }) {
  if (!vertices) return circle(context, x, y, radius);
  path(context, vertices).closePath();
  return context;
}
