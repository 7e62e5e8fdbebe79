"""How a robot (x, y, v, heading) moves and what it meets, and who has won: float64, plain numbers and plain ifs."""

import math

LEVELS = (-1, 0, 1)


def controls(body, action):
    return LEVELS[action // 3] * body.u1_max, LEVELS[action % 3] * body.u2_max


def move(body, robot, inputs, dt):
    """The arc of a constant turn, travelled at the exact mean of a speed that ramps until it meets its limit, or 0."""
    x, y, v, heading = robot
    u1, u2 = inputs
    ramp_time = dt if u1 == 0 else min(dt, (speed_limit(body, v, u1) - v) / u1)
    v_after = v + u1 * ramp_time
    travelled = (v + v_after) / 2 * ramp_time + v_after * (dt - ramp_time)

    turn = u2 * dt
    if turn == 0:
        dx, dy = travelled * math.cos(heading), travelled * math.sin(heading)
    else:
        radius = travelled / turn
        dx = radius * (math.sin(heading + turn) - math.sin(heading))
        dy = radius * (math.cos(heading) - math.cos(heading + turn))
    return x + dx, y + dy, v_after, math.remainder(heading + turn, math.tau)


def speed_limit(body, v, u1):
    """Where the ramp ends: a robot that brakes does so at rest."""
    limit = body.v_max if u1 > 0 else body.v_min
    return 0.0 if v * limit < 0 else limit


def closest_pass(a_before, a_after, b_before, b_after):
    """Least distance between two points that go straight from before to after in the same time."""
    start = (b_before[0] - a_before[0], b_before[1] - a_before[1])
    end = (b_after[0] - a_after[0], b_after[1] - a_after[1])
    length = math.dist(start, end)
    if length == 0:
        return math.hypot(*start)
    along = (end[0] - start[0]) / length, (end[1] - start[1]) / length
    ahead = -(start[0] * along[0] + start[1] * along[1])
    if ahead <= 0:
        return math.hypot(*start)
    if ahead >= length:
        return math.hypot(*end)
    return abs(start[0] * along[1] - start[1] * along[0])


def gaps(arena, radius, before, after):
    """Room [m] left to the nearest obstacle along the step, and to the nearest wall after it; negative is contact."""
    to_obstacle = math.inf
    for disc in arena.discs:
        centre = (disc.x, disc.y)
        to_obstacle = min(to_obstacle, closest_pass(before, after, centre, centre) - disc.radius - radius)
    for polygon in arena.polygons:
        to_obstacle = min(to_obstacle, polygon_pass(polygon.vertices, before, after) - radius)
    x, y = after[:2]
    to_wall = min(x - arena.x_min, arena.x_max - x, y - arena.y_min, arena.y_max - y) - radius
    return to_obstacle, to_wall


def polygon_pass(vertices, before, after):
    """Least distance of a straight step from a polygon; where it touches the inside, minus some depth of it."""
    if not meets(vertices, before, after):
        ends = [closest_pass(*edge, place, place) for edge in edges(vertices) for place in (before, after)]
        return min(ends + [closest_pass(before, after, corner, corner) for corner in vertices])
    shares = [step / 200 for step in range(201)]
    places = [[b + share * (a - b) for b, a in zip(before[:2], after[:2], strict=True)] for share in shares]
    inside = [place for place in places if winds_around(vertices, place)]
    return -max([min(closest_pass(*edge, place, place) for edge in edges(vertices)) for place in inside], default=1e-3)


def edges(vertices):
    return list(zip(vertices, vertices[1:] + vertices[:1], strict=True))


def meets(vertices, before, after):
    """Whether a straight step begins in a polygon or crosses one of its edges."""
    return winds_around(vertices, before) or any(intersect(before, after, *edge) for edge in edges(vertices))


def intersect(a, b, c, d):
    """Whether the segments a b and c d share a point, by solving for it."""
    (ux, uy), (vx, vy) = (b[0] - a[0], b[1] - a[1]), (d[0] - c[0], d[1] - c[1])
    determinant = vx * uy - ux * vy
    if determinant == 0:
        return False
    wx, wy = c[0] - a[0], c[1] - a[1]
    on_first = (vx * wy - vy * wx) / determinant
    on_second = (ux * wy - uy * wx) / determinant
    return 0 <= on_first <= 1 and 0 <= on_second <= 1


def winds_around(vertices, place):
    """Whether the angles under which a place sees the edges add up to a whole turn."""
    total = 0.0
    for edge in edges(vertices):
        before, after = (math.atan2(y - place[1], x - place[0]) for x, y in edge)
        total += math.remainder(after - before, math.tau)
    return abs(total) > math.pi


def judge(captured, pursuer_fate, evader_fate, reached, out_of_time):
    if captured:
        return "CAPTURED"
    if pursuer_fate and evader_fate:
        return "BOTH_FAILED"
    if pursuer_fate:
        return "PURSUER_" + pursuer_fate
    if evader_fate:
        return "EVADER_" + evader_fate
    if reached:
        return "TERRITORY_REACHED"
    if out_of_time:
        return "NO_RESULT"
    return "ONGOING"


def zero_sum_reward(outcome):
    if outcome == "CAPTURED" or outcome.startswith("EVADER"):
        return 1.0
    return -1.0 if outcome.startswith("PURSUER") or outcome in ("NO_RESULT", "TERRITORY_REACHED") else 0.0
