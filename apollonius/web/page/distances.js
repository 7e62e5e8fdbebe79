// How far the cells of a grid are from the nearest of some of them, exactly, row by row.

/**
 * Euclidean distances [cells] from each cell to the nearest source, endless where there is none: lower envelopes of
 * parabolas along columns, then along rows (Felzenszwalb and Huttenlocher, 2012).
 *
 * @param isSource 1 for sources, row by row
 */
export function euclidean(isSource, rows, columns) {
  const squared = Float64Array.from(isSource, (source) => (source ? 0 : Infinity));
  for (let column = 0; column < columns; column++) along(squared, column, columns, rows);
  for (let row = 0; row < rows; row++) along(squared, row * columns, 1, columns);
  return squared.map(Math.sqrt);
}

/** Least of `values[q] + (p - q)^2` for all places p of one line, in place. */
function along(squared, first, stride, count) {
  const values = Float64Array.from({ length: count }, (_, index) => squared[first + index * stride]);
  const places = new Int32Array(count); // of the parabolas in the envelope
  const from = new Float64Array(count + 1); // where each of them begins to be the lowest
  let last = -1;
  for (let q = 0; q < count; q++) {
    if (values[q] === Infinity) continue;
    let begins = -Infinity;
    while (last >= 0) {
      const p = places[last];
      begins = (values[q] + q * q - values[p] - p * p) / (2 * (q - p));
      if (begins > from[last]) break;
      last -= 1;
      begins = -Infinity;
    }
    last += 1;
    [places[last], from[last]] = [q, begins];
  }
  if (last < 0) return;
  from[last + 1] = Infinity;
  for (let p = 0, at = 0; p < count; p++) {
    while (from[at + 1] < p) at += 1;
    squared[first + p * stride] = values[places[at]] + (p - places[at]) ** 2;
  }
}

/** The same by the longer of the two ways along x and y: two sweeps. */
export function chessboard(isSource, rows, columns) {
  const away = Float64Array.from(isSource, (source) => (source ? 0 : Infinity));
  const at = (row, column) => (row < 0 || row >= rows || column < 0 || column >= columns ? Infinity : away[row * columns + column]);
  const least = (row, column, step) =>
    1 + Math.min(at(row, column - step), at(row - step, column - 1), at(row - step, column), at(row - step, column + 1));
  for (let row = 0; row < rows; row++) {
    for (let column = 0; column < columns; column++) away[row * columns + column] = Math.min(at(row, column), least(row, column, 1));
  }
  for (let row = rows - 1; row >= 0; row--) {
    for (let column = columns - 1; column >= 0; column--) away[row * columns + column] = Math.min(at(row, column), least(row, column, -1));
  }
  return away;
}

/** Connected parts of some cells, diagonals count, numbered from 1 in reading order; 0 is none. Returns {parts, sizes}. */
export function connected(isIn, rows, columns) {
  const parts = new Int32Array(isIn.length);
  const sizes = [0];
  const open = [];
  for (let first = 0; first < isIn.length; first++) {
    if (!isIn[first] || parts[first]) continue;
    const part = sizes.length;
    parts[first] = part;
    open.push(first);
    let size = 0;
    while (open.length) {
      const cell = open.pop();
      size += 1;
      const [row, column] = [Math.floor(cell / columns), cell % columns];
      for (let up = Math.max(row - 1, 0); up <= Math.min(row + 1, rows - 1); up++) {
        for (let right = Math.max(column - 1, 0); right <= Math.min(column + 1, columns - 1); right++) {
          const beside = up * columns + right;
          if (!isIn[beside] || parts[beside]) continue;
          parts[beside] = part;
          open.push(beside);
        }
      }
    }
    sizes.push(size);
  }
  return { parts, sizes };
}
