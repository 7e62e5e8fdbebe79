// An arena surveyed before anyone plays in it: `apollonius arena check`, sentence by sentence `arenas/survey.py`.

import { clearance, toPolygon } from "./clearance.js";
import { connected, euclidean } from "./distances.js";

const CELLS = 500; // along the arena's longer side
export const QUICK = 120; // where a person waits
const LEAST_PART = 1e-4; // parts smaller than this share of the arena are specks of the grid
const LEAST_ROOM = 0.02; // share of the arena from which on there is room enough to start

/** A number with so many digits that count, as Python's `g` writes it. */
const digits = (value, count = 6) => {
  const shown = Number(value.toPrecision(count));
  return Math.abs(shown) >= 10 ** count ? value.toExponential(count - 1).replace(/\.?0+e\+(\d)$/, "e+0$1") : `${shown}`;
};

/**
 * What a grid over an arena shows.
 *
 * @param cells along the arena's longer side; fewer are quicker and see less
 * @returns {wrong, notes, rows, columns, parts, haven}: lines on what makes games go wrong and on what is odd but
 *   harmless; of either side's free space the parts by their numbers; 1 where the evader is safe from every pursuer
 */
export function survey(game, cells = CELLS) {
  const { arena, starts } = game;
  const [width, height] = [arena.x_max - arena.x_min, arena.y_max - arena.y_min];
  const cell = Math.max(width, height) / cells;
  const [columns, rows] = [width, height].map((length) => Math.max(1, Math.round(length / cell)));
  const count = rows * columns;
  const xs = Float32Array.from({ length: columns }, (_, column) => arena.x_min + (width * (column + 0.5)) / columns);
  const ys = Float32Array.from({ length: rows }, (_, row) => arena.y_min + (height * (row + 0.5)) / rows);
  const room = new Float32Array(count);
  for (let row = 0; row < rows; row++) {
    for (let column = 0; column < columns; column++) room[row * columns + column] = clearance(arena, xs[column], ys[row]);
  }
  const [parts, mayStart, wrong] = [[], [], []];
  for (const name of ["pursuer", "evader"]) {
    const { radius } = game[name];
    const found = withoutSpecks(connected(atLeast(room, radius), rows, columns), count);
    if (found.sizes.length > 1) {
      const sizes = found.sizes.toSorted((a, b) => b - a).map((size) => digits(cell ** 2 * size, 3)).join(", ");
      wrong.push(
        `the ${name}'s free space falls into ${found.sizes.length} parts of ${sizes} m^2, and it never leaves the one it ` +
          `starts in: widen the passages to more than ${name}.radius = ${digits(radius)} m on each side, or fill the closed pockets.`,
      );
    }
    const start = atLeast(room, starts.clearance + radius);
    const share = start.reduce((sum, one) => sum + one, 0) / count;
    if (share < LEAST_ROOM) {
      wrong.push(
        `the ${name} can start on ${(100 * share).toFixed(2)}% of the arena only, less than 2%: make starts.clearance or the obstacles smaller.`,
      );
    }
    parts.push(found.parts);
    mayStart.push(start);
  }
  const haven = findHaven(game, parts, mayStart[0], { rows, columns, cell });
  const safe = haven.reduce((sum, one) => sum + one, 0);
  if (safe) {
    wrong.push(
      `the evader is safe on ${digits(cell ** 2 * safe, 3)} m^2, where no pursuer comes within capture_distance = ` +
        `${digits(game.capture_distance)} m as it does not fit: make the pursuer smaller or the passages wider.`,
    );
  }
  if (arena.territory && !isTerritoryReached(arena.territory, parts[1], mayStart[1], xs, ys)) {
    wrong.push("the evader cannot come into arena.territory from where it starts: move it, or make the way wider.");
  }
  return { wrong, notes: notesOn(game, cell, xs, ys), rows, columns, parts, haven };
}

const atLeast = (room, least) => Uint8Array.from(room, (length) => length >= least);

/** Parts numbered from 1 again, specks left out, and the sizes of those that are left. */
function withoutSpecks({ parts, sizes }, count) {
  const kept = sizes.map((size, part) => (part && size > LEAST_PART * count ? part : 0)).filter(Boolean);
  const renumbered = new Map(kept.map((part, index) => [part, index + 1]));
  return { parts: parts.map((part) => renumbered.get(part) ?? 0), sizes: kept.map((part) => sizes[part]) };
}

/** 1 where a robot can ever be: in the parts in which it can start. */
function entered(parts, mayStart) {
  const open = new Set();
  parts.forEach((part, index) => part && mayStart[index] && open.add(part));
  return Uint8Array.from(parts, (part) => open.has(part));
}

function findHaven(game, parts, mayStart, { rows, columns, cell }) {
  const reach = euclidean(entered(parts[0], mayStart), rows, columns);
  return Uint8Array.from(parts[1], (part, index) => part > 0 && reach[index] * cell - cell >= game.capture_distance);
}

function isTerritoryReached({ x, y, radius }, parts, mayStart, xs, ys) {
  return entered(parts, mayStart).some((isOpen, index) => {
    return isOpen && Math.hypot(xs[index % xs.length] - x, ys[Math.floor(index / xs.length)] - y) < radius;
  });
}

/** Overlaps of discs as depths; those with polygons, whose depths are no such simple matter, as areas. */
function notesOn({ arena, capture_distance: capture, pursuer, evader }, cell, xs, ys) {
  const notes = [];
  const say = (found, what, unit) => {
    if (!found.length) return;
    const most = Math.max(...found.map(([, size]) => size));
    notes.push(`${found.map(([name]) => name).join("; ")} ${what} ${digits(most, 3)} ${unit}.`);
  };
  const shapes = [...arena.discs.map(asShape), ...(arena.polygons ?? []).map(asShape)];
  const names = shapes.map((_, i) => (i < arena.discs.length ? `arena.discs[${i}]` : `arena.polygons[${i - arena.discs.length}]`));
  const pairs = names.flatMap((_, i) => names.slice(i + 1).map((_, j) => [i, i + 1 + j]));
  const both = ([i, j]) => `${names[i]} and ${names[j]}`;
  const { discs } = arena;
  const depth = ([i, j]) => discs[i].radius + discs[j].radius - Math.hypot(discs[i].x - discs[j].x, discs[i].y - discs[j].y);
  const depths = pairs.filter(([, j]) => j < discs.length).map((pair) => [both(pair), depth(pair)]);
  say(depths.filter(([, size]) => size > 0), "overlap, by up to", "m");
  const mixed = pairs.filter(([, j]) => j >= discs.length);
  const areas = mixed.map(([i, j]) => [both([i, j]), cell ** 2 * cellsShared(shapes[i], shapes[j], xs, ys)]);
  say(areas.filter(([, area]) => area > cell ** 2), "overlap, on up to", "m^2");
  const beyond = discs.map(({ x, y, radius }, i) => {
    return [names[i], radius - Math.min(x - arena.x_min, arena.x_max - x, y - arena.y_min, arena.y_max - y)];
  });
  say(beyond.filter(([, size]) => size > 0), "reach beyond a wall, by up to", "m");
  const bodies = pursuer.radius + evader.radius;
  if (capture < bodies) {
    notes.push(
      `the bodies overlap before they count as caught: capture_distance = ${digits(capture)} m is less than both radii together, ${digits(bodies)} m.`,
    );
  }
  return notes;
}

/** Of a disc or polygon: how far a place is from it, and the box around it. */
function asShape(shape) {
  const { x, y, radius, vertices } = shape;
  if (!vertices) {
    const away = (px, py) => Math.hypot(px - x, py - y) - radius;
    return { away, left: x - radius, right: x + radius, low: y - radius, high: y + radius };
  }
  const [xs, ys] = [0, 1].map((axis) => vertices.map((corner) => corner[axis]));
  const box = { left: Math.min(...xs), right: Math.max(...xs), low: Math.min(...ys), high: Math.max(...ys) };
  return { away: (px, py) => toPolygon(shape, px, py), ...box };
}

/** How many cells' middles are in both of two shapes. */
function cellsShared(one, two, xs, ys) {
  const between = (places, low, high) => places.filter((place) => place >= low && place <= high);
  const columns = between(xs, Math.max(one.left, two.left), Math.min(one.right, two.right));
  const rows = between(ys, Math.max(one.low, two.low), Math.min(one.high, two.high));
  let shared = 0;
  for (const y of rows) for (const x of columns) if (one.away(x, y) < 0 && two.away(x, y) < 0) shared += 1;
  return shared;
}
