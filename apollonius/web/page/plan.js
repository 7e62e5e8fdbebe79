// Arenas changed by a person's hand: every function takes a game and returns another. Lengths in metres, on a grid.

import { clip } from "./game.js";

export const GRID = 0.1; // places are multiples of this [m]
export const WALL = 0.2; // how thick drawn walls are [m]
export const DOOR = 1.2; // how wide doors are, and corridors between their walls [m]
const LEAST = 0.1; // smallest radius, and smallest length of a wall [m]
const [SMALLEST, LARGEST] = [2, 60]; // of an arena's sides [m]
const APART = 1e-6; // what is nearer [m] touches

const round = (value, step = 1e-3) => Number((Math.round(value / step) * step).toFixed(3));
/** The nearest place on the grid. */
export const snapped = ([x, y]) => [round(x, GRID), round(y, GRID)];
const inside = ({ x_min, x_max, y_min, y_max }, [x, y]) => [round(clip(x, x_min, x_max)), round(clip(y, y_min, y_max))];

const withArena = (game, changes) => ({ ...game, arena: { ...game.arena, ...changes } });

/** With more polygons; the same game where none of them is a shape. */
function withPolygons(game, corners) {
  const more = corners.filter(isShape).map((vertices) => ({ vertices }));
  return more.length ? withArena(game, { polygons: [...game.arena.polygons, ...more] }) : game;
}

/** Return whether corners make an obstacle: an area inside, and no edge that meets another. */
function isShape(corners) {
  const area = corners.reduce((sum, [x, y], index) => {
    const [toX, toY] = corners[(index + 1) % corners.length];
    return sum + x * toY - toX * y;
  }, 0);
  return Math.abs(area) > 1e-3 && !hasMeetingEdges(corners);
}

/** Return whether edges meet elsewhere than at a corner they share. */
export function hasMeetingEdges(corners) {
  const count = corners.length;
  const edges = corners.map(([x, y], index) => {
    const [toX, toY] = corners[(index + 1) % count];
    const length = Math.max(Math.hypot(toX - x, toY - y), APART);
    return { x, y, along: [(toX - x) / length, (toY - y) / length], length };
  });
  /** Return the distances of a corner to the left of an edge's line, and ahead along it [m]. */
  const beside = ({ x, y, along: [alongX, alongY] }, [px, py]) => [alongX * (py - y) - alongY * (px - x), alongX * (px - x) + alongY * (py - y)];
  const isParted = (edge, index) => beside(edge, corners[index])[0] * beside(edge, corners[(index + 1) % count])[0] < 0;
  return edges.some((edge, i) =>
    corners.some((corner, j) => {
      const [left, ahead] = beside(edge, corner);
      const isOther = j !== i && j !== (i + 1) % count;
      const touches = isOther && Math.abs(left) <= APART && ahead >= -APART && ahead <= edge.length + APART;
      return touches || (isParted(edge, j) && isParted(edges[j], i));
    }),
  );
}

// ---- shapes added

export function withDisc(game, [x, y], radius) {
  const [inX, inY] = inside(game.arena, [x, y]);
  return withArena(game, { discs: [...game.arena.discs, { x: inX, y: inY, radius: Math.max(LEAST, round(radius)) }] });
}

/** A block between two opposite corners. */
export const withBlock = (game, from, to) => withPolygons(game, [rectangle(game.arena, from, to)]);

function rectangle(arena, from, to) {
  const [[x, y], [toX, toY]] = [inside(arena, from), inside(arena, to)];
  return [[x, y], [toX, y], [toX, toY], [x, toY]];
}

/** A straight wall from one place to another, so thick; `beside` is how far it is moved to the left of its line. */
function strip(arena, [x, y], [toX, toY], beside = 0) {
  const length = Math.hypot(toX - x, toY - y);
  if (length < LEAST) return [];
  const [leftX, leftY] = [-(toY - y) / length, (toX - x) / length];
  const at = (px, py, away) => inside(arena, [px + away * leftX, py + away * leftY]);
  const [near, far] = [beside - WALL / 2, beside + WALL / 2];
  return [at(x, y, near), at(toX, toY, near), at(toX, toY, far), at(x, y, far)];
}

export const withWall = (game, from, to) => withPolygons(game, [strip(game.arena, from, to)]);

/** Two walls with a way as wide as a door between them. */
export function withCorridor(game, from, to) {
  const away = (DOOR + WALL) / 2;
  return withPolygons(game, [strip(game.arena, from, to, away), strip(game.arena, from, to, -away)]);
}

/** Four walls that meet at their ends, a door in the middle of the lowest one. */
export function withRoom(game, from, to) {
  const [left, right] = [from[0], to[0]].toSorted((a, b) => a - b);
  const [low, high] = [from[1], to[1]].toSorted((a, b) => a - b);
  if (Math.min(right - left, high - low) < DOOR) return game;
  const { arena } = game;
  const [inLeft, inRight] = [left + WALL, right - WALL];
  const middle = (left + right) / 2;
  return withPolygons(game, [
    rectangle(arena, [left, low], [inLeft, high]),
    rectangle(arena, [inRight, low], [right, high]),
    rectangle(arena, [inLeft, high - WALL], [inRight, high]),
    rectangle(arena, [inLeft, low], [middle - DOOR / 2, low + WALL]),
    rectangle(arena, [middle + DOOR / 2, low], [inRight, low + WALL]),
  ]);
}

/** A door in a straight wall, where it was pointed at: the wall becomes two. The same game where there is none. */
export function withDoor(game, place) {
  const shape = shapeAt(game, place, DOOR / 2, "polygons");
  const corners = shape && game.arena.polygons[shape.index].vertices;
  if (corners?.length !== 4) return game;
  const side = (index) => Math.hypot(corners[(index + 1) % 4][0] - corners[index][0], corners[(index + 1) % 4][1] - corners[index][1]);
  const [a, b, c, d] = side(0) >= side(1) ? corners : [...corners.slice(1), corners[0]]; // a to b is a long side
  const length = Math.hypot(b[0] - a[0], b[1] - a[1]);
  const along = ((place[0] - a[0]) * (b[0] - a[0]) + (place[1] - a[1]) * (b[1] - a[1])) / length ** 2;
  const [before, after] = [clip(along - DOOR / 2 / length, 0, 1), clip(along + DOOR / 2 / length, 0, 1)];
  const between = ([x, y], [toX, toY], share) => [round(x + share * (toX - x)), round(y + share * (toY - y))];
  const parts = [
    [a, between(a, b, before), between(d, c, before), d],
    [between(a, b, after), b, c, between(d, c, after)],
  ];
  return withPolygons(without(game, shape), parts);
}

// ---- shapes changed: a shape is {kind, index}, kind "discs" or "polygons"

/** The topmost shape at a place, or the nearest within reach; or null. */
export function shapeAt({ arena }, [x, y], reach = 0, only = null) {
  const shapes = [
    ...arena.discs.map((disc, index) => ({ kind: "discs", index, away: Math.hypot(x - disc.x, y - disc.y) - disc.radius })),
    ...arena.polygons.map(({ vertices }, index) => ({ kind: "polygons", index, away: awayFrom(vertices, [x, y]) })),
  ];
  const near = shapes.filter(({ kind, away }) => away <= reach && (only === null || kind === only));
  const [nearest] = near.toSorted((one, two) => Math.max(one.away, 0) - Math.max(two.away, 0) || two.index - one.index);
  return nearest ? { kind: nearest.kind, index: nearest.index } : null;
}

/** Distance [m] from a place to a polygon, 0 or less inside. */
function awayFrom(corners, [x, y]) {
  let [least, isInside] = [Infinity, false];
  corners.forEach(([fromX, fromY], index) => {
    const [toX, toY] = corners[(index + 1) % corners.length];
    const [alongX, alongY] = [toX - fromX, toY - fromY];
    const share = clip(((x - fromX) * alongX + (y - fromY) * alongY) / Math.max(alongX ** 2 + alongY ** 2, 1e-12), 0, 1);
    least = Math.min(least, Math.hypot(x - fromX - share * alongX, y - fromY - share * alongY));
    if (fromY > y !== toY > y && x < fromX + ((y - fromY) / alongY) * alongX) isInside = !isInside;
  });
  return isInside ? -least : least;
}

const changed = (game, { kind, index }, shape) => withArena(game, { [kind]: game.arena[kind].with(index, shape) });

export const without = (game, { kind, index }) => withArena(game, { [kind]: game.arena[kind].toSpliced(index, 1) });

/** A shape moved as far as it stays inside the walls. */
export function moved(game, shape, [dx, dy]) {
  const { arena } = game;
  const places = handles(game, shape).corners;
  const [xs, ys] = [0, 1].map((axis) => places.map((place) => place[axis]));
  const right = clip(dx, arena.x_min - Math.min(...xs), arena.x_max - Math.max(...xs));
  const up = clip(dy, arena.y_min - Math.min(...ys), arena.y_max - Math.max(...ys));
  const found = arena[shape.kind][shape.index];
  if (shape.kind === "discs") return changed(game, shape, { ...found, x: round(found.x + right), y: round(found.y + up) });
  return changed(game, shape, { vertices: found.vertices.map(([x, y]) => [round(x + right), round(y + up)]) });
}

/** Return the points by which a shape is resized, and those that must stay inside the walls. */
export function handles({ arena }, { kind, index }) {
  const found = arena[kind][index];
  if (kind === "polygons") return { grips: found.vertices, corners: found.vertices };
  return { grips: [[found.x + found.radius, found.y]], corners: [[found.x, found.y]] };
}

/** A shape with one of its handles elsewhere: a disc's radius, a corner; blocks along the axes stay blocks. */
export function resized(game, shape, grip, place) {
  const found = game.arena[shape.kind][shape.index];
  if (shape.kind === "discs") {
    return changed(game, shape, { ...found, radius: Math.max(LEAST, round(Math.hypot(place[0] - found.x, place[1] - found.y), GRID / 2)) });
  }
  const { vertices } = found;
  const [x, y] = inside(game.arena, place);
  const [oldX, oldY] = vertices[grip];
  const isBlock = vertices.length === 4 && [0, 1].every((axis) => new Set(vertices.map((corner) => corner[axis])).size === 2);
  const corners = isBlock
    ? vertices.map(([cornerX, cornerY]) => [cornerX === oldX ? x : cornerX, cornerY === oldY ? y : cornerY])
    : vertices.with(grip, [x, y]);
  return isShape(corners) ? changed(game, shape, { vertices: corners }) : game;
}

// ---- the rest of a game

/** Another size of the arena; what is then outside is left out. */
export function withSize(game, width, height) {
  const { arena } = game;
  const [x_max, y_max] = [arena.x_min + clip(width, SMALLEST, LARGEST), arena.y_min + clip(height, SMALLEST, LARGEST)];
  const isIn = ([x, y]) => x <= x_max && y <= y_max;
  const { territory } = arena;
  const smaller = {
    x_max,
    y_max,
    discs: arena.discs.filter(({ x, y }) => isIn([x, y])),
    polygons: arena.polygons.filter(({ vertices }) => vertices.every(isIn)),
  };
  const next = withArena(game, smaller);
  if (territory && !isIn([territory.x, territory.y])) delete next.arena.territory;
  return next;
}

/** Nothing in the arena. */
export const cleared = (game) => {
  const { map: _map, territory: _territory, ...arena } = game.arena;
  return { ...game, arena: { ...arena, discs: [], polygons: [] } };
};
