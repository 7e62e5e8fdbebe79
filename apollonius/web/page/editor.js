// An arena under a person's hand: tools for pointers and keys, what is selected, undo. Changes are those of `plan.js`.

import { circle, path } from "./arena.js";
import { begin, drawGround, placing } from "./draw.js";
import * as plan from "./plan.js";

const TAP = 0.25; // a pointer that moved less [m] has tapped
const TOUCH = 18; // how near a finger hits [px]
const DEPTH = 200; // changes that can be undone
const TAPPED = { disc: 0.5, wall: 2, block: 1, room: 3, corridor: 3 }; // sizes of what a tap makes [m]

/** Games by tools that are dragged from one point to another. */
const MAKES = {
  disc: (game, [x, y], [toX, toY]) => plan.withDisc(game, [x, y], Math.hypot(toX - x, toY - y)),
  wall: plan.withWall,
  block: plan.withBlock,
  room: plan.withRoom,
  corridor: plan.withCorridor,
};
export const TOOLS = ["select", ...Object.keys(MAKES), "door", "erase"];

export class Editor {
  /** @param onChange called after every change that stays, with the game */
  constructor(canvas, onChange) {
    Object.assign(this, { canvas, onChange, game: null, tool: "select", selected: null, gesture: null, past: [], future: [] });
    canvas.addEventListener("pointerdown", (event) => this.#down(event));
    canvas.addEventListener("pointermove", (event) => this.#move(event));
    canvas.addEventListener("pointerup", (event) => this.#up(event));
    canvas.addEventListener("pointercancel", () => this.#cancel());
  }

  /** Begin with a game; nothing of what was before can be undone. */
  open(game) {
    Object.assign(this, { game, selected: null, gesture: null, past: [], future: [] });
    this.onChange(game);
  }

  /** Another game in this one's place; it can be undone. */
  change(game) {
    if (game === this.game) return;
    this.past = [...this.past, this.game].slice(-DEPTH);
    this.future = [];
    this.game = game;
    if (this.selected && !game.arena[this.selected.kind][this.selected.index]) this.selected = null;
    this.onChange(game);
  }

  undo() {
    if (this.past.length) this.#step(this.past.pop(), this.future);
  }

  redo() {
    if (this.future.length) this.#step(this.future.pop(), this.past);
  }

  #step(game, other) {
    other.push(this.game);
    Object.assign(this, { game, selected: null });
    this.onChange(game);
  }

  /** Remove what is selected. */
  remove() {
    const { selected } = this;
    if (!selected) return;
    this.selected = null;
    this.change(plan.without(this.game, selected));
  }

  /** Use a tool in the middle of the arena, as who has no pointer does. */
  useInTheMiddle(tool) {
    if (!(tool in MAKES)) return;
    const { x_min, x_max, y_min, y_max } = this.game.arena;
    this.#make(tool, plan.snapped([(x_min + x_max) / 2, (y_min + y_max) / 2]));
  }

  /** Hear a key; returns whether it was one of the editor's. */
  key(event) {
    const nudge = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.code];
    if (event.ctrlKey || event.metaKey) {
      if (event.code === "KeyZ") event.shiftKey ? this.redo() : this.undo();
      else if (event.code === "KeyY") this.redo();
      else return false;
    } else if (event.code === "Delete" || event.code === "Backspace") this.remove();
    else if (event.code === "Escape") this.selected = null;
    else if (nudge && this.selected) this.change(plan.moved(this.game, this.selected, nudge.map((way) => way * plan.GRID)));
    else return false;
    return true;
  }

  // ---- pointers

  #place(event) {
    const ratio = globalThis.devicePixelRatio;
    const { scale, x, y } = placing(this.canvas, this.game.arena);
    const box = this.canvas.getBoundingClientRect();
    const place = [((event.clientX - box.left) * ratio - x) / scale, (y - (event.clientY - box.top) * ratio) / scale];
    return { place, reach: (TOUCH * ratio) / scale };
  }

  #down(event) {
    if (!this.game || this.gesture || document.body.dataset.phase !== "drawing") return;
    event.preventDefault();
    this.canvas.setPointerCapture(event.pointerId);
    const { place, reach } = this.#place(event);
    const base = { base: this.game, from: place, pointer: event.pointerId };
    if (this.tool !== "select") {
      this.gesture = { ...base, kind: this.tool, snapped: plan.snapped(place), reach };
      return;
    }
    const grips = this.selected ? plan.handles(this.game, this.selected).grips : [];
    const grip = grips.findIndex(([x, y]) => Math.hypot(x - place[0], y - place[1]) <= reach);
    if (grip >= 0) this.gesture = { ...base, kind: "resize", grip };
    else {
      this.selected = plan.shapeAt(this.game, place, reach / 2);
      this.gesture = this.selected ? { ...base, kind: "move" } : null;
    }
  }

  #move(event) {
    const { gesture } = this;
    if (!gesture || event.pointerId !== gesture.pointer) return;
    const { place } = this.#place(event);
    const [dx, dy] = plan.snapped([place[0] - gesture.from[0], place[1] - gesture.from[1]]);
    if (gesture.kind === "move") this.game = plan.moved(gesture.base, this.selected, [dx, dy]);
    else if (gesture.kind === "resize") this.game = plan.resized(gesture.base, this.selected, gesture.grip, plan.snapped(place));
    else if (gesture.kind in MAKES) this.game = MAKES[gesture.kind](gesture.base, gesture.snapped, plan.snapped(place));
  }

  #up(event) {
    const { gesture } = this;
    if (!gesture || event.pointerId !== gesture.pointer) return;
    this.#move(event);
    const { place } = this.#place(event);
    const hasTapped = Math.hypot(place[0] - gesture.from[0], place[1] - gesture.from[1]) < TAP;
    const drawn = this.game;
    this.#cancel();
    if (gesture.kind === "door") this.change(plan.withDoor(gesture.base, place));
    else if (gesture.kind === "erase") {
      const shape = plan.shapeAt(gesture.base, place, gesture.reach / 2);
      if (shape) this.change(plan.without(gesture.base, shape));
    } else if (gesture.kind in MAKES && hasTapped) this.#make(gesture.kind, gesture.snapped);
    else {
      this.change(drawn);
      if (gesture.kind in MAKES) this.#selectNewest(gesture.base);
    }
  }

  #cancel() {
    if (this.gesture) this.game = this.gesture.base;
    this.gesture = null;
  }

  /** Make a shape of the usual size around a point, as a tap does. */
  #make(tool, [x, y]) {
    const half = TAPPED[tool] / 2;
    const flat = tool === "wall" || tool === "corridor" ? 0 : half;
    const [from, to] = tool === "disc" ? [[x, y], [x + TAPPED.disc, y]] : [[x - half, y - flat], [x + half, y + flat]];
    const { game } = this;
    this.change(MAKES[tool](game, from, to));
    this.#selectNewest(game);
  }

  #selectNewest(before) {
    for (const kind of ["discs", "polygons"]) {
      const count = this.game.arena[kind].length;
      if (count > before.arena[kind].length) this.selected = { kind, index: count - 1 };
    }
  }

  // ---- drawing

  /** Draw the arena, with what is selected and what `survey` has found, or null. */
  draw(colours, found) {
    const { game, selected } = this;
    const context = begin(this.canvas, game.arena);
    drawGround(context, game.arena, colours);
    if (found) drawCutOff(context, game.arena, found, colours);
    if (!selected || !game.arena[selected.kind][selected.index]) return;
    const unit = (globalThis.devicePixelRatio * 1) / placing(this.canvas, game.arena).scale; // a pixel [m]
    context.lineWidth = 2 * unit;
    context.strokeStyle = context.fillStyle = colours.evader;
    const { grips, corners } = plan.handles(game, selected);
    const shape = game.arena[selected.kind][selected.index];
    if (selected.kind === "discs") circle(context, shape.x, shape.y, shape.radius).stroke();
    else path(context, [...corners, corners[0]]).stroke();
    for (const [x, y] of grips) circle(context, x, y, 6 * unit).fill();
  }
}

const pictures = new WeakMap();

/** Cells of free space that are cut off from the largest part, as `arena check` paints them. */
function drawCutOff(context, arena, found, colours) {
  if (!pictures.has(found)) pictures.set(found, paint(found, colours.other));
  context.save();
  context.imageSmoothingEnabled = false;
  context.globalAlpha = 0.45;
  context.drawImage(pictures.get(found), arena.x_min, arena.y_min, arena.x_max - arena.x_min, arena.y_max - arena.y_min);
  context.restore();
}

/** A canvas with the first row at its top, as lengths along y point up. */
function paint({ rows, columns, parts }, colour) {
  const canvas = new OffscreenCanvas(columns, rows);
  const context = canvas.getContext("2d");
  context.fillStyle = colour;
  for (const side of parts) {
    const sizes = new Map();
    for (const part of side) if (part) sizes.set(part, (sizes.get(part) ?? 0) + 1);
    const most = Math.max(...sizes.values());
    side.forEach((part, cell) => part && sizes.get(part) < most && context.fillRect(cell % columns, Math.floor(cell / columns), 1, 1));
  }
  return canvas;
}
