// Places on a chart, which says how much room there is at each place of an arena, and how long the ways between places are.
// The package's functions read it (`apollonius/game/chart.py`); `charting.js` draws it.

import { clip } from "./clearance.js";
import { handChart } from "./handing.js";
import { run } from "./programs.js";

export const SIDE = 192; // cells of the field of clearances along the arena's longer side
export const STOPS = 40; // stops along it, between which the ways are known
export const STOP_BITS = 11; // bits of a stop's number
const CORNERS = SIDE + 1;

/** What a grid of numbers, row by row, says between them. */
function interpolated(grid, rows, columns, column, row) {
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

/**
 * The field of clearances [m] between its corners.
 *
 * @param column, row a place, in cells
 */
export const roomBetween = (field, column, row) => interpolated(field, CORNERS, CORNERS, column, row);

/** The stop before a cell's middle along one axis; both are counted. */
export const stopBefore = (cell) => clip(Math.floor(((cell + 0.5) / SIDE) * STOPS - 0.5), 0, STOPS - 2);

/** The stops of a chart around a point, and their weights. */
export function placesOf(chart, x, y) {
  handChart(chart, []);
  const { stops, weights } = run.places(x, y);
  return { stops: [...stops()], weights: [...weights()] };
}
