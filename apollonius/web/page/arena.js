// What every picture of a game has in it: obstacles, walls and trails, from above, on a canvas that has been scaled to metres.

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

/** Where a robot has been, with a ring around its start. */
export function drawTrail(context, points, colour) {
  context.strokeStyle = colour;
  context.lineWidth = 0.035;
  path(context, points).stroke();
  circle(context, ...points[0], 0.08).stroke();
}
