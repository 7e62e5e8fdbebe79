// What is wrong with an arena, as a coarse grid shows it; `apollonius arena check` looks closer and says more.

import { clearance } from "./calls.js";
import { ROLES } from "./game.js";

const CELLS = 120; // along the arena's longer side
const LEAST_PART = 2; // cells; smaller parts are specks of the grid
const LEAST_START = 0.02; // share of the arena in which a robot should be able to start

/**
 * Survey the arena of a game.
 *
 * @returns {wrong, rows, columns, parts}: what makes games go wrong, a line each; of either side's free space the part
 *   that each cell belongs to, from 1, and 0 where it is not free
 */
export function survey({ arena, starts, ...game }) {
  const [width, height] = [arena.x_max - arena.x_min, arena.y_max - arena.y_min];
  const [columns, rows] = [width, height].map((length) => Math.max(1, Math.round((length * CELLS) / Math.max(width, height))));
  const clearances = Float32Array.from({ length: rows * columns }, (_, cell) => {
    const [row, column] = [Math.floor(cell / columns), cell % columns];
    return clearance(arena, arena.x_min + (width * (column + 0.5)) / columns, arena.y_min + (height * (row + 0.5)) / rows);
  });
  const share = (least) => clearances.reduce((count, found) => count + (found >= least), 0) / clearances.length;
  const wrong = [];
  const parts = ROLES.map((name) => {
    const { radius } = game[name];
    const found = connected(clearances, radius, columns);
    if (found.count > 1) {
      wrong.push(
        `the ${name}'s free space falls into ${found.count} parts, and it never leaves the one it starts in: widen the ` +
          `passages to more than ${name}.radius = ${radius} m on each side, or fill the closed pockets.`,
      );
    }
    const room = share(starts.clearance + radius);
    if (room < LEAST_START) {
      wrong.push(`the ${name} can start on ${(100 * room).toFixed(1)}% of the arena only: make starts.clearance or the obstacles smaller.`);
    }
    return found.parts;
  });
  return { wrong, rows, columns, parts };
}

/** Number the connected parts of the cells with at least some clearance; cells that touch at a corner are connected. */
function connected(clearances, least, columns) {
  const parts = new Int32Array(clearances.length);
  let count = 0;
  clearances.forEach((_, first) => {
    if (parts[first] || clearances[first] < least) return;
    parts[first] = count + 1;
    const cells = [first];
    for (const cell of cells) {
      for (const row of [-columns, 0, columns]) {
        for (const step of [-1, 0, 1]) {
          const next = cell + row + step;
          const isBeside = Math.abs((next % columns) - (cell % columns)) <= 1;
          if (!isBeside || !(clearances[next] >= least) || parts[next]) continue;
          parts[next] = count + 1;
          cells.push(next);
        }
      }
    }
    if (cells.length >= LEAST_PART) count += 1;
    else for (const cell of cells) parts[cell] = 0;
  });
  return { parts, count };
}
