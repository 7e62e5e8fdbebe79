"""The rules a second time: one step, float64, plain numbers and plain ifs, robot by robot.

A robot is a dictionary: its body's limits, its place (x, y, v, heading) and its status. How one robot alone moves, and
how near it comes to what stands about, is in `numpy_game`. Only the numbers of a `Game` are read, never its methods, so
that a mistake must be made twice to go unseen.
"""

import math
from dataclasses import dataclass

from tests.oracle import numpy_game as alone

FAILURES = ("HIT_OBSTACLE", "OUT_OF_RANGE", "HIT_MATE")


@dataclass(frozen=True)
class Step:
    """What one step led to. `margin` [m] says how far the nearest contact was from happening or not happening."""

    pursuers: list
    evaders: list
    outcome: str
    pursuer_rewards: list
    evader_rewards: list
    margin: float


def step(game, pursuers, evaders, steps, pursuer_actions, evader_actions, mates_collide=False):
    margins = [math.inf]

    def below(gap):
        margins.append(abs(gap))
        return gap < 0

    before = [dict(robot) for robot in pursuers + evaders]
    after = [drive(game, robot, action) for robot, action in zip(before, pursuer_actions + evader_actions, strict=True)]
    sides = ["pursuer"] * len(pursuers) + ["evader"] * len(evaders)
    playing = [number for number, robot in enumerate(before) if robot["status"] == "ACTIVE"]

    def pass_of(one, other):
        ends = (before[one]["place"], after[one]["place"], before[other]["place"], after[other]["place"])
        return alone.closest_pass(*ends)

    fate = {}
    for number in playing:
        fate[number] = "ACTIVE"
        radius = before[number]["body"].radius
        for other in playing if mates_collide else ():
            is_mate = other != number and sides[other] == sides[number]
            if is_mate and below(pass_of(number, other) - radius - before[other]["body"].radius):
                fate[number] = "HIT_MATE"
        to_obstacle, to_wall = alone.gaps(game.arena, radius, before[number]["place"], after[number]["place"])
        if below(to_wall):
            fate[number] = "OUT_OF_RANGE"
        if below(to_obstacle):
            fate[number] = "HIT_OBSTACLE"
        for hunter in playing:
            hunted = sides[number] == "evader" and sides[hunter] == "pursuer"
            if hunted and below(pass_of(hunter, number) - game.capture_distance):
                fate[number] = "CAPTURED"
    for number, found in fate.items():
        after[number]["status"] = found

    def left(side):
        return [number for number in playing if sides[number] == side and fate[number] == "ACTIVE"]

    reached = False
    if game.arena.territory:
        goal = game.arena.territory
        for number in left("evader"):
            ends = before[number]["place"], after[number]["place"]
            reached |= below(alone.closest_pass(*ends, (goal.x, goal.y), (goal.x, goal.y)) - goal.radius)

    def lost_by(side):
        """What put out the last of a side that nobody is left of, as the game's outcome says it."""
        found = [fate[number] for number in playing if sides[number] == side]
        if left(side) or not found:
            return None
        if "CAPTURED" in found:
            return "CAPTURED"
        return "HIT_OBSTACLE" if "HIT_OBSTACLE" in found or "HIT_MATE" in found else "OUT_OF_RANGE"

    pursuers_lost, evaders_lost = lost_by("pursuer"), lost_by("evader")
    captured = evaders_lost == "CAPTURED"
    outcome = alone.judge(captured, pursuers_lost, evaders_lost, reached, steps + 1 >= game.max_steps)

    reward, rewards = game.reward, [0.0] * len(before)
    hunters = [number for number in playing if sides[number] == "pursuer"]
    closed, shared = {}, 0.0
    for number in playing:
        if sides[number] == "evader":
            closed[number] = nearest(before, hunters, number) - nearest(after, hunters, number)
            shared += reward.capture if fate[number] == "CAPTURED" else reward.progress * closed[number]
    for number in playing:
        if sides[number] == "pursuer":
            rewards[number] = -reward.capture if outcome == "TERRITORY_REACHED" else shared
        elif fate[number] == "CAPTURED":
            rewards[number] = -reward.capture
        else:
            rewards[number] = reward.capture if outcome == "TERRITORY_REACHED" else -reward.progress * closed[number]
        if fate[number] in FAILURES and (sides[number] == "evader" or outcome != "CAPTURED"):
            rewards[number] = -reward.failure
    if reward.profile == "zero-sum":
        gain = alone.zero_sum_reward(outcome)
        rewards = [gain if side == "pursuer" else -gain for side in sides]
    count = len(pursuers)
    return Step(after[:count], after[count:], outcome, rewards[:count], rewards[count:], min(margins))


def drive(game, robot, action):
    x, y, _, heading = robot["place"]
    if robot["status"] != "ACTIVE":
        return {**robot, "place": (x, y, 0.0, heading)}
    body = robot["body"]
    return {**robot, "place": alone.move(body, robot["place"], alone.controls(body, action), game.dt)}


def nearest(robots, hunters, number):
    here = robots[number]["place"][:2]
    return min((math.dist(robots[hunter]["place"][:2], here) for hunter in hunters), default=0.0)
