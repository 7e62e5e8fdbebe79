// The shortest ways between the stops of an arena: those from one stop to all others are looked for when they are first
// asked for, as all of them at once would take half a second.

import { STOPS, roomBetween } from "./chart.js";

const STEPS = [[1, 0], [0, 1], [1, 1], [1, -1], [2, 1], [1, 2], [2, -1], [1, -2]]; // to stops beside, and as many back
const MOST = 2 * STEPS.length;
const NO_WAY = 2 ** 16 - 1; // the length of a way that there is not [cm]
const LOOKS = 16; // places on a line at which is looked whether there is room
const COUNT = STOPS ** 2;

/** Whether a body fits all along a line between two places, in cells. */
export function isClear(field, x, y, toX, toY, radius) {
  for (let look = 0; look < LOOKS; look++) {
    const share = look === LOOKS - 1 ? 1 : look * (1 / (LOOKS - 1));
    if (!(roomBetween(field, x + share * (toX - x), y + share * (toY - y)) > radius)) return false;
  }
  return true;
}

/** To the nearest whole number, from the middle to the even one, as NumPy does. */
function rounded(number) {
  const up = Math.round(number);
  return up - number === 0.5 && up % 2 === 1 ? up - 1 : up;
}

export class Ways {
  /**
   * @param field clearances [m]
   * @param places of the stops along either axis, in cells
   * @param isOpen whether the body fits at each stop
   * @param side the arena's longer side [m]
   * @param radius of the body [m]
   */
  constructor({ field, places, isOpen, side, radius }) {
    this.shortest = side / STOPS;
    this.counts = new Uint8Array(COUNT); // of the stops that each can be left for, and which, and how far they are [m]
    this.ends = new Uint16Array(COUNT * MOST);
    this.lengths = new Float64Array(COUNT * MOST);
    this.rows = new Map();
    this.prepared = 0; // stops that have been prepared
    for (const [right, up] of STEPS) {
      const length = (Math.hypot(right, up) * side) / STOPS;
      for (let stop = 0; stop < COUNT; stop++) {
        const column = (stop % STOPS) + right;
        const row = Math.floor(stop / STOPS) + up;
        if (column >= STOPS || row < 0 || row >= STOPS) continue;
        const [end, x, y] = [row * STOPS + column, places[column - right], places[row - up]];
        if (!isOpen[stop] || !isOpen[end] || !isClear(field, x, y, places[column], places[row], radius)) continue;
        this.#join(stop, end, length);
        this.#join(end, stop, length);
      }
    }
  }

  #join(stop, end, length) {
    const at = stop * MOST + this.counts[stop]++;
    [this.ends[at], this.lengths[at]] = [end, length];
  }

  /** Whether there is a way from a stop to any other. */
  leads(stop) {
    return this.counts[stop] > 0;
  }

  /** Lengths [cm] of the ways from a stop to all. */
  from(stop) {
    if (!this.rows.has(stop)) this.rows.set(stop, Uint16Array.from(this.#search(stop), (way) => Math.min(rounded(100 * way), NO_WAY)));
    return this.rows.get(stop);
  }

  /** Look for some of the ways that will be asked for, until a time [ms] of the browser's clock. */
  prepare(until) {
    for (; this.prepared < COUNT && performance.now() < until; this.prepared++) if (this.leads(this.prepared)) this.from(this.prepared);
  }

  /**
   * The same [m]: Dijkstra's search with buckets as wide as the shortest step is long (Dial, 1969), so that within one
   * the order does not matter.
   */
  #search(start) {
    const { counts, ends, lengths, shortest } = this;
    const ways = new Float64Array(COUNT).fill(Infinity);
    const isDone = new Uint8Array(COUNT);
    const buckets = [[start]];
    ways[start] = 0;
    for (let number = 0; number < buckets.length; number++) {
      for (const stop of buckets[number] ?? []) {
        if (isDone[stop]) continue;
        isDone[stop] = 1;
        for (let at = stop * MOST; at < stop * MOST + counts[stop]; at++) {
          const [end, way] = [ends[at], ways[stop] + lengths[at]];
          if (way >= ways[end]) continue;
          [ways[end], isDone[end]] = [way, 0];
          (buckets[Math.floor(way / shortest)] ??= []).push(end);
        }
      }
    }
    return ways;
  }
}
