// Arenas changed by a person's hand: every function takes a game and returns another. Lengths in metres, on a grid.

import { clip } from "./game.js";

export const GRID = 0.1; // points are multiples of this [m]
const WALL = 0.2; // how thick drawn walls are [m]
const LEAST = 0.1; // smallest radius, and smallest length of a wall [m]
const [SMALLEST, LARGEST] = [2, 60]; // of an arena's sides [m]
const APART = 1e-6; // what is nearer [m] touches
const NEAR = 0.25; // to a wall [m], where a point is drawn to it, as slits let robots through

const round = (value, step = 1e-3) => Number((Math.round(value / step) * step).toFixed(3));
/** The nearest point on the grid. */
export const snapped = ([x, y]) => [round(x, GRID), round(y, GRID)];

/** The nearest point of a segment. */
function nearestOn([x, y], [[fromX, fromY], [toX, toY]]) {
  const [alongX, alongY] = [toX - fromX, toY - fromY];
  const share = clip(((x - fromX) * alongX + (y - fromY) * alongY) / Math.max(alongX ** 2 + alongY ** 2, APART), 0, 1);
  return [fromX + share * alongX, fromY + share * alongY];
}

/** The nearest point of an arena's polygons, if one is near. */
function nearestWall({ polygons = [] }, [x, y], near) {
  const edges = polygons.flatMap(({ vertices }) => vertices.map((corner, index) => [corner, vertices[(index + 1) % vertices.length]]));
  const away = ([toX, toY]) => Math.hypot(toX - x, toY - y);
  const points = edges.map((edge) => nearestOn([x, y], edge)).filter((point) => away(point) <= near);
  return points.sort((one, two) => away(one) - away(two))[0] ?? null;
}

/** A point of a wall or block that is drawn: on the arena's border or on another wall if it is near, or else on the grid. */
export function joined({ arena }, [x, y]) {
  const onBorder = (length, ...borders) => borders.find((border) => Math.abs(length - border) <= NEAR);
  const border = [onBorder(x, arena.x_min, arena.x_max), onBorder(y, arena.y_min, arena.y_max)];
  if (border[0] === undefined && border[1] === undefined) {
    const wall = nearestWall(arena, snapped([x, y]), NEAR);
    if (wall) return wall.map((length) => round(length));
  }
  return [border[0] ?? round(x, GRID), border[1] ?? round(y, GRID)];
}

const inside = ({ x_min, x_max, y_min, y_max }, [x, y]) => [round(clip(x, x_min, x_max)), round(clip(y, y_min, y_max))];

const withArena = (game, changes) => ({ ...game, arena: { ...game.arena, ...changes } });

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

/** A disc around a point, as wide as the distance to another. */
export function withDisc(game, [x, y], [toX, toY]) {
  const [inX, inY] = inside(game.arena, [x, y]);
  const radius = Math.max(LEAST, round(Math.hypot(toX - x, toY - y)));
  return withArena(game, { discs: [...game.arena.discs, { x: inX, y: inY, radius }] });
}

/** With a polygon, its corners moved inside the walls; the same game where that is no shape. */
function withPolygon(game, corners) {
  const vertices = corners.map((corner) => inside(game.arena, corner));
  return hasMeetingEdges(vertices) ? game : withArena(game, { polygons: [...game.arena.polygons, { vertices }] });
}

/** A block between two opposite corners. */
export const withBlock = (game, [x, y], [toX, toY]) => withPolygon(game, [[x, y], [toX, y], [toX, toY], [x, toY]]);

/** A straight wall from one point to another; where it meets another wall it fills the corner. */
export function withWall(game, from, to) {
  const length = Math.hypot(to[0] - from[0], to[1] - from[1]);
  if (length < LEAST) return game;
  const [alongX, alongY] = [((to[0] - from[0]) / length) * (WALL / 2), ((to[1] - from[1]) / length) * (WALL / 2)];
  const [leftX, leftY] = [-alongY, alongX];
  const meets = (point) => Number(nearestWall(game.arena, point, APART) !== null);
  const [before, after] = [meets(from), meets(to)];
  const [x, y] = [from[0] - before * alongX, from[1] - before * alongY];
  const [toX, toY] = [to[0] + after * alongX, to[1] + after * alongY];
  return withPolygon(game, [[x - leftX, y - leftY], [toX - leftX, toY - leftY], [toX + leftX, toY + leftY], [x + leftX, y + leftY]]);
}

// ---- shapes changed: a shape is {kind, index}, kind "discs" or "polygons"

const changed = (game, { kind, index }, shape) => withArena(game, { [kind]: game.arena[kind].with(index, shape) });

export const without = (game, { kind, index }) => withArena(game, { [kind]: game.arena[kind].toSpliced(index, 1) });

/** A shape moved as far as it stays inside the walls. */
export function moved(game, shape, [dx, dy]) {
  const { arena } = game;
  const found = arena[shape.kind][shape.index];
  const points = shape.kind === "discs" ? [[found.x, found.y]] : found.vertices;
  const [xs, ys] = [0, 1].map((axis) => points.map((point) => point[axis]));
  const right = clip(dx, arena.x_min - Math.min(...xs), arena.x_max - Math.max(...xs));
  const up = clip(dy, arena.y_min - Math.min(...ys), arena.y_max - Math.max(...ys));
  const vertices = points.map(([x, y]) => [round(x + right), round(y + up)]);
  const [[x, y]] = vertices;
  return changed(game, shape, shape.kind === "discs" ? { ...found, x, y } : { vertices });
}

/** Return the points by which a shape is resized. */
export function gripsOf({ arena }, { kind, index }) {
  const { x, y, radius, vertices } = arena[kind][index];
  return kind === "discs" ? [[x + radius, y]] : vertices;
}

/** A shape with one of its grips elsewhere: a disc's radius, a corner; blocks along the axes stay blocks. */
export function resized(game, shape, grip, point) {
  const found = game.arena[shape.kind][shape.index];
  if (shape.kind === "discs") {
    return changed(game, shape, { ...found, radius: Math.max(LEAST, round(Math.hypot(point[0] - found.x, point[1] - found.y), GRID / 2)) });
  }
  const { vertices } = found;
  const [x, y] = inside(game.arena, point);
  const [oldX, oldY] = vertices[grip];
  const isBlock = vertices.length === 4 && [0, 1].every((axis) => new Set(vertices.map((corner) => corner[axis])).size === 2);
  const corners = isBlock
    ? vertices.map(([cornerX, cornerY]) => [cornerX === oldX ? x : cornerX, cornerY === oldY ? y : cornerY])
    : vertices.with(grip, [x, y]);
  return hasMeetingEdges(corners) ? game : changed(game, shape, { vertices: corners });
}

// ---- the rest of a game

/** Another size of the arena; what is then outside is left out. */
export function withSize(game, width, height) {
  const { x_min, y_min, discs, polygons, territory, ...arena } = game.arena;
  const [x_max, y_max] = [x_min + clip(width, SMALLEST, LARGEST), y_min + clip(height, SMALLEST, LARGEST)];
  const isIn = ([x, y]) => x <= x_max && y <= y_max;
  const inside = ({ x, y }) => isIn([x, y]);
  const rest = { discs: discs.filter(inside), polygons: polygons.filter(({ vertices }) => vertices.every(isIn)) };
  const goal = territory && inside(territory) ? { territory } : {};
  return { ...game, arena: { ...arena, x_min, x_max, y_min, y_max, ...rest, ...goal } };
}

/** Nothing in the arena. */
export const cleared = (game) => {
  const { map: _map, territory: _territory, ...arena } = game.arena;
  return { ...game, arena: { ...arena, discs: [], polygons: [] } };
};
