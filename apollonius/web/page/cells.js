// The occupied cells of a map, from above.

const MOST = 2048; // pixels along a side; of a larger map some cells are left out
const pictures = new WeakMap();

/** Draw them on a canvas that has been scaled to metres. */
export function drawMap(context, map, colour) {
  const picture = pictures.get(map);
  if (picture?.colour !== colour) pictures.set(map, { colour, canvas: paint(map, colour) });
  const [width, height] = [(map.columns - 1) * map.cell, (map.rows - 1) * map.cell];
  context.imageSmoothingEnabled = false;
  context.drawImage(pictures.get(map).canvas, map.x, map.y, width, height);
}

/** A canvas with the cells, the first row at its top, as lengths along y point up. */
function paint({ rows, columns, field }, colour) {
  const every = Math.ceil(Math.max(rows - 1, columns - 1) / MOST);
  const canvas = document.createElement("canvas");
  canvas.width = Math.ceil((columns - 1) / every);
  canvas.height = Math.ceil((rows - 1) / every);
  const context = canvas.getContext("2d");
  context.fillStyle = colour;
  for (let row = 0; row < canvas.height; row++) {
    for (let column = 0; column < canvas.width; column++) {
      const at = every * (row * columns + column);
      const corners = field[at] + field[at + 1] + field[at + columns] + field[at + columns + 1];
      if (corners <= 0) context.fillRect(column, row, 1, 1);
    }
  }
  return canvas;
}
