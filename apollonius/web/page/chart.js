// What is known of an arena beforehand: how much room there is at each place, and how long the ways between places are.
// Function by function `apollonius/game/chart.py`; `charting.js` draws charts.

import { clip, interpolated } from "./clearance.js";

export const SIDE = 192; // cells of the field of clearances along the arena's longer side
export const STOPS = 40; // stops along it, between which the ways are known
export const STOP_BITS = 11; // bits of a stop's number
export const FARTHEST = 12; // where rays end that meet nothing [m]
const GLANCES = 12; // steps in which a ray is followed
const CORNERS = SIDE + 1;

/**
 * The field of clearances [m] between its corners.
 *
 * @param column, row a place, in cells
 */
export const roomBetween = (field, column, row) => interpolated(field, CORNERS, CORNERS, column, row);

/** The stop before a cell's middle along one axis; both are counted. */
export const stopBefore = (cell) => clip(Math.floor(((cell + 0.5) / SIDE) * STOPS - 0.5), 0, STOPS - 2);

export class Chart {
  /**
   * @param x, y the lower left corner [m]
   * @param side the longer side [m]
   * @param field clearances [m] at the corners of cells, row by row from the bottom
   * @param beside for each cell the stop nearest to it, and which of the four around it can be seen
   * @param ways the lengths [cm] of the ways from one stop to all, by its number: `Ways.from`
   */
  constructor({ x, y, side, field, beside, ways }) {
    Object.assign(this, { x: Math.fround(x), y: Math.fround(y), side: Math.fround(side), field, beside, ways });
    this.cell = Math.fround(this.side / SIDE);
  }

  /** Distance [m] from a point to the nearest wall or obstacle, interpolated; negative beyond. */
  room(x, y) {
    return roomBetween(this.field, (x - this.x) / this.cell, (y - this.y) / this.cell);
  }

  /** Distance [m] from a point to the first wall or obstacle in a direction, `FARTHEST` at most. */
  range(x, y, cos, sin) {
    let along = 0;
    for (let glance = 0; glance < GLANCES; glance++) {
      along = Math.min(along + Math.max(this.room(x + along * cos, y + along * sin), 0), FARTHEST);
    }
    return along;
  }

  /** The stops around a point that can be seen from there, and their weights; else the nearest one alone. */
  places(x, y) {
    const shares = [(x - this.x) / this.side, (y - this.y) / this.side];
    // In single precision: on a cell's edge the package decides so.
    const [column, row] = shares.map((share) => clip(Math.floor(Math.fround(Math.fround(share) * SIDE)), 0, SIDE - 1));
    const [first, low] = [stopBefore(column), stopBefore(row)];
    const right = clip(shares[0] * STOPS - 0.5 - first, 0, 1);
    const up = clip(shares[1] * STOPS - 0.5 - low, 0, 1);
    const known = this.beside[row * SIDE + column];
    const stop = low * STOPS + first;
    const stops = [stop, stop + 1, stop + STOPS, stop + STOPS + 1];
    const weights = [(1 - right) * (1 - up), right * (1 - up), (1 - right) * up, right * up].map(
      (weight, bit) => (weight + 1e-3) * ((known >> (STOP_BITS + bit)) & 1),
    );
    const total = weights.reduce((sum, weight) => sum + weight);
    if (total === 0) return { stops: [known & (2 ** STOP_BITS - 1)], weights: [1] };
    return { stops, weights: weights.map((weight) => Math.fround(weight / total)) };
  }

  /** Length [m] of the shortest way between two points, given by their places. */
  way(start, end) {
    return start.stops.reduce((sum, stop, index) => {
      const weight = start.weights[index];
      return weight ? sum + weight * this.wayFrom(stop, end) : sum;
    }, 0);
  }

  /** The same from one stop. */
  wayFrom(stop, { stops, weights }) {
    const lengths = this.ways.from(stop);
    return stops.reduce((sum, end, index) => sum + weights[index] * lengths[end], 0) / 100;
  }
}
