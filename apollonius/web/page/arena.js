// What every picture of a game has in it: obstacles, walls and trails, from above, on a canvas that has been scaled to metres.

const MOST_PIXELS = 2048; // along a side of a map's picture; of a larger map some cells are left out
const mapPictures = new WeakMap();

/** A circle, to be filled or stroked. */
export function circle(context, x, y, radius) {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  return context;
}

/** Lines from point to point, [x, y] each, to be filled or stroked. */
export function path(context, points) {
  context.beginPath();
  for (const [x, y] of points) context.lineTo(x, y);
  return context;
}

/** Obstacles, territory and walls of an arena. Cells of an occupancy map are left out. */
export function drawArena(context, arena, colours) {
  context.fillStyle = colours.obstacle;
  for (const disc of arena.discs) circle(context, disc.x, disc.y, disc.radius).fill();
  for (const { vertices } of arena.polygons ?? []) path(context, vertices).fill();
  context.lineWidth = 0.05;
  if (arena.territory) {
    const { x, y, radius } = arena.territory;
    context.strokeStyle = colours.evader;
    circle(context, x, y, radius).stroke();
  }
  context.strokeStyle = colours.ink;
  context.strokeRect(arena.x_min, arena.y_min, arena.x_max - arena.x_min, arena.y_max - arena.y_min);
}

/** Draw the path of a robot, with a ring around its start. */
export function drawTrail(context, points, colour) {
  context.strokeStyle = colour;
  context.lineWidth = 0.035;
  path(context, points).stroke();
  circle(context, ...points[0], 0.08).stroke();
}

/** Draw the occupied cells of a map. */
export function drawMap(context, map, colour) {
  const picture = mapPictures.get(map);
  if (picture?.colour !== colour) mapPictures.set(map, { colour, canvas: paint(map, colour) });
  const [width, height] = [(map.columns - 1) * map.cell, (map.rows - 1) * map.cell];
  context.imageSmoothingEnabled = false;
  context.drawImage(mapPictures.get(map).canvas, map.x, map.y, width, height);
}

/** A canvas with the cells, the first row at its top, as lengths along y point up. */
function paint({ rows, columns, field }, colour) {
  const every = Math.ceil(Math.max(rows - 1, columns - 1) / MOST_PIXELS);
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
