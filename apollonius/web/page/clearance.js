// How far places and steps are from walls and obstacles.

import { handArena } from "./handing.js";
import { given, run } from "./programs.js";

export const clip = (value, low, high) => Math.min(Math.max(value, low), high);

/** Distance [m] from a point to the nearest wall or obstacle; negative outside the walls or inside an obstacle. */
export function clearance(arena, x, y) {
  handArena(arena);
  return run.clearance(x, y)[0];
}

/** Least clearance [m] on the segment between two states of a robot. */
export function clearanceAlong(arena, before, after) {
  handArena(arena);
  for (const key of ["x", "y"]) [given.robot()[key][0], given.end()[key][0]] = [before[key], after[key]];
  return run.clearance_along()[0];
}

const alone = new WeakMap(); // arenas with one polygon and no walls

/** Distance [m] from a point to the nearest edge of one polygon; negative inside. */
export function toPolygon(polygon, x, y) {
  const nowhere = { x_min: -Infinity, x_max: Infinity, y_min: -Infinity, y_max: Infinity };
  if (!alone.has(polygon)) alone.set(polygon, { ...nowhere, discs: [], polygons: [polygon] });
  return clearance(alone.get(polygon), x, y);
}
