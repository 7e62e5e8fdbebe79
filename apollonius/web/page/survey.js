// What is wrong with an arena, as a coarse grid shows it; `apollonius arena check` looks closer and says more.

import { clearance } from "./calls.js";

const ALONG = 120; // cells along the arena's longer side
const LEAST_PART = 2; // cells; smaller parts are specks of the grid

/** Return in a line what makes the games of an arena go wrong, or null: free space that is cut off from the rest. */
export function survey({ arena, pursuer, evader }) {
  const [width, height] = [arena.x_max - arena.x_min, arena.y_max - arena.y_min];
  const [columns, rows] = [width, height].map((length) => Math.max(1, Math.round((length * ALONG) / Math.max(width, height))));
  const radius = Math.max(pursuer.radius, evader.radius);
  const isFree = Array.from({ length: rows * columns }, (_, cell) => {
    const [row, column] = [Math.floor(cell / columns), cell % columns];
    return clearance(arena, arena.x_min + (width * (column + 0.5)) / columns, arena.y_min + (height * (row + 0.5)) / rows) >= radius;
  });
  const count = parts(isFree, columns);
  if (count < 2) return null;
  return (
    `the free space falls into ${count} parts, and a robot never leaves the one it starts in: open passages` +
    `${radius ? ` of more than ${Number((2 * radius).toFixed(2))} m` : ""}, or fill the closed pockets.`
  );
}

/** Count the connected parts of the free cells; cells that touch at a corner are connected. */
function parts(isFree, columns) {
  const seen = new Set();
  return isFree.reduce((count, free, first) => {
    if (!free || seen.has(first)) return count;
    const cells = [first];
    seen.add(first);
    for (const cell of cells) {
      for (const row of [-columns, 0, columns]) {
        for (const step of [-1, 0, 1]) {
          const next = cell + row + step;
          const isBeside = Math.abs((next % columns) - (cell % columns)) <= 1;
          if (!isBeside || !isFree[next] || seen.has(next)) continue;
          seen.add(next);
          cells.push(next);
        }
      }
    }
    return count + (cells.length >= LEAST_PART ? 1 : 0);
  }, 0);
}
