// How far places and steps are from walls and obstacles, function by function `arena.py`, `polygon.py` and
// `occupancy.py` of `apollonius/game/`.

export const clip = (value, low, high) => Math.min(Math.max(value, low), high);

/** Squared distance [m^2] from the origin to the segment from (px, py) to (px + dx, py + dy). */
function closestApproachSquared(px, py, dx, dy) {
  const fraction = clip(-(px * dx + py * dy) / Math.max(dx * dx + dy * dy, 1e-12), 0, 1);
  const [x, y] = [px + fraction * dx, py + fraction * dy];
  return x * x + y * y;
}

/** Distance [m] from the origin to the segment from (px, py) to (px + dx, py + dy). */
export const closestApproach = (px, py, dx, dy) => Math.sqrt(closestApproachSquared(px, py, dx, dy));

// ---- walls

function toWalls(arena, x, y) {
  return Math.min(x - arena.x_min, arena.x_max - x, y - arena.y_min, arena.y_max - y);
}

/** Whether a body reaches beyond a wall. */
export function isOutOfRange(arena, after, radius) {
  return toWalls(arena, after.x, after.y) < radius;
}

// ---- polygons

const PASSED_THROUGH = -1e-6;
const edgesByPolygons = new WeakMap();

/** Edges of all polygons in single precision: where each begins, the way to its end, 1 if it runs counter-clockwise. */
function edgesOf(polygons) {
  if (!edgesByPolygons.has(polygons)) edgesByPolygons.set(polygons, polygons.flatMap(({ vertices }) => edges(vertices)));
  return edgesByPolygons.get(polygons);
}

function edges(vertices) {
  const corners = vertices.map((corner) => corner.map(Math.fround));
  const next = (index) => corners[(index + 1) % corners.length];
  const area = corners.reduce((sum, [x, y], index) => sum + x * next(index)[1] - next(index)[0] * y, 0);
  return corners.map(([x, y], index) => {
    const [alongX, alongY] = [Math.fround(next(index)[0] - x), Math.fround(next(index)[1] - y)];
    return { x, y, alongX, alongY, turn: area > 0 ? 1 : -1 };
  });
}

/** How far a point is to the left of an edge's line, times the edge's length. */
const left = ({ x, y, alongX, alongY }, px, py) => alongX * (py - y) - alongY * (px - x);

/** Distance [m] from a point to the nearest edge of some polygons; negative inside of one. */
function toPolygons(edges, px, py) {
  let [squared, windings] = [Infinity, 0];
  for (const edge of edges) {
    const { x, y, alongX, alongY, turn } = edge;
    squared = Math.min(squared, closestApproachSquared(x - px, y - py, alongX, alongY));
    const endsAbove = y + alongY > py;
    if (y > py !== endsAbove && left(edge, px, py) > 0 === endsAbove) windings += endsAbove ? turn : -turn;
  }
  return windings > 0 ? -Math.sqrt(squared) : Math.sqrt(squared);
}

/** Least clearance [m] from some polygons on the segment between two states. */
function polygonsAlong(edges, before, after) {
  const [dx, dy] = [after.x - before.x, after.y - before.y];
  const step = { x: before.x, y: before.y, alongX: dx, alongY: dy };
  let least = Math.min(toPolygons(edges, before.x, before.y), toPolygons(edges, after.x, after.y));
  for (const edge of edges) {
    const { x, y, alongX, alongY } = edge;
    const crossed =
      left(edge, before.x, before.y) * left(edge, after.x, after.y) < 0 &&
      left(step, x, y) * left(step, x + alongX, y + alongY) < 0;
    least = Math.min(least, crossed ? PASSED_THROUGH : closestApproach(before.x - x, before.y - y, dx, dy));
  }
  return least;
}

// ---- occupancy maps: {x, y, cell, rows, columns, field}, rows and columns of the corners of their cells

const ROUNDING = 0.15; // what is taken off, in cells, as interpolation can be too high by almost that
const PARTS = 4; // of a step, at whose ends a map is looked up

/** What a grid of numbers, row by row, says between them. */
export function interpolated(grid, rows, columns, column, row) {
  const inColumn = clip(column, 0, columns - 1);
  const inRow = clip(row, 0, rows - 1);
  const first = Math.min(Math.floor(inColumn), columns - 2);
  const low = Math.min(Math.floor(inRow), rows - 2);
  const right = inColumn - first;
  const up = inRow - low;
  const at = low * columns + first;
  const below = (1 - right) * grid[at] + right * grid[at + 1];
  const above = (1 - right) * grid[at + columns] + right * grid[at + columns + 1];
  return (1 - up) * below + up * above;
}

function toMap({ x, y, cell, rows, columns, field }, px, py) {
  return interpolated(field, rows, columns, (px - x) / cell, (py - y) / cell) - ROUNDING * cell;
}

/** No more than the least clearance [m] from a map on the segment between two states. */
function mapAlong(map, before, after) {
  const [dx, dy] = [after.x - before.x, after.y - before.y];
  const apart = Math.hypot(dx, dy) / PARTS;
  let [least, last] = [Infinity, Infinity];
  for (let part = 0; part <= PARTS; part++) {
    const here = toMap(map, before.x + (part / PARTS) * dx, before.y + (part / PARTS) * dy);
    least = Math.min(least, here, (last + here - apart) / 2);
    last = here;
  }
  return least;
}

// ---- all of them

/** None in games that were recorded before there were polygons. */
const polygonsOf = (arena) => (arena.polygons?.length ? edgesOf(arena.polygons) : null);

/** Distance [m] from a point to the nearest obstacle; negative inside one, endless where there is none. */
function toObstacles(arena, x, y) {
  let least = Infinity;
  for (const disc of arena.discs) least = Math.min(least, Math.hypot(x - disc.x, y - disc.y) - disc.radius);
  const edges = polygonsOf(arena);
  if (edges) least = Math.min(least, toPolygons(edges, x, y));
  return arena.map ? Math.min(least, toMap(arena.map, x, y)) : least;
}

/** Distance [m] from a point to the nearest wall or obstacle; negative outside the walls or inside an obstacle. */
export const clearance = (arena, x, y) => Math.min(toWalls(arena, x, y), toObstacles(arena, x, y));

/** Distance [m] from a point to the nearest edge of one polygon; negative inside. */
export function toPolygon(polygon, x, y) {
  if (!edgesByPolygons.has(polygon)) edgesByPolygons.set(polygon, edges(polygon.vertices));
  return toPolygons(edgesByPolygons.get(polygon), x, y);
}

/** Least clearance [m] from any obstacle on the segment between two states of a robot. */
function fromObstacles(arena, before, after) {
  const [dx, dy] = [after.x - before.x, after.y - before.y];
  const fromDiscs = arena.discs.map(
    (disc) => closestApproach(before.x - disc.x, before.y - disc.y, dx, dy) - disc.radius,
  );
  const edges = polygonsOf(arena);
  const fromPolygons = edges ? polygonsAlong(edges, before, after) : Infinity;
  return Math.min(...fromDiscs, fromPolygons, arena.map ? mapAlong(arena.map, before, after) : Infinity);
}

/** Least clearance [m] on the segment between two states of a robot. */
export function clearanceAlong(arena, before, after) {
  const walls = Math.min(toWalls(arena, before.x, before.y), toWalls(arena, after.x, after.y));
  return Math.min(walls, fromObstacles(arena, before, after));
}

/** Whether a body touches an obstacle on the segment between two states. */
export function hitsObstacle(arena, before, after, radius) {
  return fromObstacles(arena, before, after) < radius;
}

/** Whether a robot's centre comes into the territory on the segment between two states. */
export function reachesTerritory({ territory }, before, after) {
  const [x, y] = [before.x - territory.x, before.y - territory.y];
  return closestApproach(x, y, after.x - before.x, after.y - before.y) < territory.radius;
}
