// Charts drawn, once for a game before anyone plays it: function by function `apollonius/arenas/charting.py`.

import { SIDE, STOPS, STOP_BITS, roomBetween, stopBefore } from "./chart.js";
import { clearance } from "./clearance.js";
import { ROLES } from "./rules.js";
import { bodiesOf } from "./teams.js";
import { Ways, isClear } from "./ways.js";

const CORNERS = SIDE + 1;
const charts = new WeakMap();

/** The chart of a game's arena, by the ways of its largest robot. */
export function chartOf(game) {
  const radii = () => ROLES.flatMap((role) => bodiesOf(game, role).map(({ radius }) => radius));
  if (!charts.has(game)) charts.set(game, drawn(game.arena, Math.max(...radii())));
  return charts.get(game);
}

/** Use some time [ms] in which nothing else is to be done for a game's chart, if it has one. */
export const prepareChart = (game, milliseconds) => charts.get(game)?.ways.prepare(performance.now() + milliseconds);

/**
 * A chart: the lower left corner x, y [m], its longer side [m], clearances [m] at the corners of cells, row by row from the
 * bottom, for each cell the stop nearest to it, and which of the four around it can be seen, and the ways between stops.
 */
function drawn(arena, radius) {
  const { x_min: x, y_min: y } = arena;
  const side = Math.max(arena.x_max - x, arena.y_max - y);
  const field = clearances(arena, side);
  const places = Array.from({ length: STOPS }, (_, stop) => ((stop + 0.5) / STOPS) * SIDE);
  const isOpen = Uint8Array.from({ length: STOPS ** 2 }, (_, stop) => {
    return roomBetween(field, places[stop % STOPS], places[Math.floor(stop / STOPS)]) > radius;
  });
  const ways = new Ways({ field, places, isOpen, side, radius });
  const isReached = isOpen.map((open, stop) => open && ways.leads(stop));
  return { x, y, side, field, beside: seenBeside(field, places, isReached), ways };
}

/** The field, in single precision as the package has it. */
function clearances(arena, side) {
  const field = new Float32Array(CORNERS ** 2);
  const along = (low) => {
    return Array.from({ length: CORNERS }, (_, corner) => {
      return Math.fround(Math.fround(low) + Math.fround(corner === SIDE ? side : corner * (side / SIDE)));
    });
  };
  const [columns, rows] = [along(arena.x_min), along(arena.y_min)];
  rows.forEach((y, row) => columns.forEach((x, column) => (field[row * CORNERS + column] = clearance(arena, x, y))));
  return field;
}

/** For each cell the number of the nearest stop, and a bit for each of the four around it that can be seen. */
function seenBeside(field, places, isOpen) {
  const seen = new Uint16Array(SIDE ** 2);
  const found = new Int16Array(SIDE ** 2).fill(-1);
  for (let row = 0; row < SIDE; row++) {
    for (let column = 0; column < SIDE; column++) {
      const [x, y] = [column, row].map((cell) => ((cell + 0.5) / SIDE) * SIDE);
      if (!(roomBetween(field, x, y) > 0)) continue;
      const [left, low, at] = [stopBefore(column), stopBefore(row), row * SIDE + column];
      let shortest = Infinity;
      for (let bit = 0; bit < 4; bit++) {
        const [stopColumn, stopRow] = [left + (bit & 1), low + (bit >> 1)];
        const [stop, stopX, stopY] = [stopRow * STOPS + stopColumn, places[stopColumn], places[stopRow]];
        if (!isOpen[stop] || !isClear(field, x, y, stopX, stopY, 0)) continue;
        seen[at] |= 1 << (STOP_BITS + bit);
        const away = Math.hypot(x - stopX, y - stopY);
        if (away < shortest) [shortest, found[at]] = [away, stop];
      }
    }
  }
  const nearest = spread(found, field);
  return seen.map((bits, cell) => bits | nearest[cell]);
}

/** Each cell that has no stop takes that of one beside it that has, first through free cells, then through all. */
function spread(found, field) {
  const isFree = Uint8Array.from(found, (_, cell) => {
    const at = Math.floor(cell / SIDE) * CORNERS + (cell % SIDE);
    const above = Math.fround(field[at + CORNERS + 1] + field[at + CORNERS]);
    return Math.fround(Math.fround(above + field[at + 1]) + field[at]) > 0;
  });
  for (const may of [isFree, new Uint8Array(found.length).fill(1)]) {
    for (let before = null; before !== found; ) [before, found] = [found, widened(found, may)];
  }
  return found.map((stop) => Math.max(stop, 0));
}

/** The same, where the cells beside those that have a stop may take it; itself when none does. */
function widened(found, may) {
  let wide = found;
  for (let cell = 0; cell < found.length; cell++) {
    if (found[cell] >= 0 || !may[cell]) continue;
    const column = cell % SIDE;
    const stop = Math.max(
      column > 0 ? found[cell - 1] : -1,
      column < SIDE - 1 ? found[cell + 1] : -1,
      found[cell - SIDE] ?? -1,
      found[cell + SIDE] ?? -1,
    );
    if (stop < 0) continue;
    if (wide === found) wide = found.slice();
    wide[cell] = stop;
  }
  return wide;
}
