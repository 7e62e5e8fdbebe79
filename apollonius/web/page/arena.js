// What every picture of a game has in it: obstacles, walls and trails, from above, on a canvas. Needs nothing else.
// Where there is an `at`, it leads from metres to the canvas's own lengths, {x, y} of places and {scale} of lengths.

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

/** Obstacles, territory and walls of an arena; lines are so `wide`. Cells of an occupancy map are left out. */
export function drawArena(context, arena, at, colours, wide) {
  context.fillStyle = colours.obstacle;
  for (const disc of arena.discs) circle(context, at.x(disc.x), at.y(disc.y), disc.radius * at.scale).fill();
  for (const { vertices } of arena.polygons ?? []) path(context, vertices.map(([x, y]) => [at.x(x), at.y(y)])).fill();
  context.lineWidth = wide;
  if (arena.territory) {
    const { x, y, radius } = arena.territory;
    context.strokeStyle = colours.evader;
    circle(context, at.x(x), at.y(y), radius * at.scale).stroke();
  }
  context.strokeStyle = colours.ink;
  const [left, top] = [at.x(arena.x_min), at.y(arena.y_max)];
  context.strokeRect(left, top, at.x(arena.x_max) - left, at.y(arena.y_min) - top);
}

/** Where a robot has been, with a ring around its start. */
export function drawTrail(context, points, colour, wide, ring, dash = []) {
  context.strokeStyle = context.fillStyle = colour;
  context.lineWidth = wide;
  context.setLineDash(dash);
  path(context, points).stroke();
  context.setLineDash([]);
  circle(context, ...points[0], ring).stroke();
}
