"""Whether the starts that the zoo's evader loses to a planner that knows it are lost by force:
`python benchmarks/lost_starts.py OUT`.

Three questions about each start, in the game `paper`:

- How long is the evader out of reach of every pursuer, by the best of some courses?
- Which policies survive the planner that knows them? They drive a course and then play as `evader`.
  Two that survive 10 s are played for 30 s, four times each, against a planner that draws three
  times as many courses.
- Does a pursuer that compares many courses of both sides (`MatrixPursuer`) catch every answer that
  a beam search of the evader against it finds within 20 s, and all these policies?

A start is `forced` if that pursuer catches all these and no policy survives the planner;
`not forced` if a policy survives these four games. Neither is a proof. The fourteen lost
starts of seed 0 are those of `docs/results/any/lost.json`; those of other seeds are lost within
15 s. OUT is read first, so that a stopped run is continued. Two minutes of a core a start.
"""

import argparse
import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from escape_room import Reach, drive, reach_of, rooms
from half_seconds import STEPS, rows_of, some_courses
from jaxtyping import Array, Int
from knowing_planner import KnowingPlanner, make_knowing_planner, survive
from matrix_pursuer import MatrixPursuer, make_matrix_pursuer, search_answers, survive_matrix

from apollonius.agents.policy import Memory
from apollonius.agents.source import NamedPlayer
from apollonius.evaluate.match import Match, draw_starts, play_games
from apollonius.exploit.attack import Attack
from apollonius.exploit.attackers import PLANNER, planner_against
from apollonius.game.game import Game
from apollonius.game.outcome import PURSUER_WINS
from apollonius.game.presets import make_game
from apollonius.game.types import BySide, GameState, RobotState, Role

GAMES = 100
"""Games of a seed."""
OTHER_SEEDS = {1: 8, 2: 8, 3: 7, 4: 7}
"""Lost starts taken of each other seed, the first ones."""
WIDTHS = 48, 192
"""Widths of the beams of the evader's answers to the matrix pursuer."""
POLICIES = 30
"""Policies of a start, at most, beside `evader` itself."""
LENGTHS = 25, 10, 40
"""Steps of the courses with which they begin."""
SHORT, LONG = 20, 60
"""Half seconds for which all policies are played, and two of those that survive them."""
REPEATS = 4
"""Games of each of these two."""


class Start(NamedTuple):
    """A lost start: seed, number, and steps until it was lost."""

    seed: int
    number: int
    lost_after: int

    def __str__(self) -> str:
        return f"{self.seed}/{self.number}"


@cache
def starts_of(seed: int) -> tuple[Attack, GameState]:
    """Return the attack on `evader` and the starts of a seed."""
    attack = Attack(Role.EVADER, "evader", "paper")
    players = BySide(attack.player, attack.player)
    return attack, draw_starts(Match(attack.rules, players, GAMES, seed))[0]


def lost_starts(seed: int) -> list[Start]:
    """Return the first lost starts of a seed; those of seed 0 are read."""
    attack, _ = starts_of(seed)
    if seed == 0:
        text = Path("docs/results/any/lost.json").read_text(encoding="utf-8")
        return [
            Start(0, row["start"], round(10 * row["seconds"])) for row in json.loads(text)["lost"]
        ]
    game = replace(attack.rules, max_steps=150)
    planner = NamedPlayer(PLANNER, planner_against(attack.player, Role.EVADER, game))
    results = play_games(Match(game, BySide(planner, attack.player), GAMES, seed), slots=GAMES)
    lost = np.flatnonzero(np.isin(results.outcome, PURSUER_WINS))[: OTHER_SEEDS[seed]]
    return [Start(seed, int(number), int(results.steps[number])) for number in lost]


class Tools(NamedTuple):
    """What answers the questions about all starts."""

    game: Game
    reach: Reach
    courses: Int[Array, "courses steps"]
    pursuer: MatrixPursuer
    planner: KnowingPlanner
    thorough: KnowingPlanner


def make_tools() -> Tools:
    """Make them, in some seconds."""
    attack, _ = starts_of(0)
    game = make_game("paper")
    return Tools(
        game,
        reach_of(game.pursuer, float(game.dt), STEPS),
        some_courses(0, 200),
        make_matrix_pursuer(game),
        make_knowing_planner(attack),
        make_knowing_planner(attack, more=3),
    )


def policies(tools: Tools, robots: tuple[RobotState, RobotState], room: np.ndarray) -> Memory:
    """Return the memories of the policies of a start: `evader`, and those of different courses with
    much room.
    """
    states, _ = drive(tools.game, Role.EVADER, robots[1], tools.courses)
    places = np.stack([np.asarray(states.x), np.asarray(states.y)])[:, :, [9, 19, 29]]
    different: list[int] = []
    for course in np.argsort(-room):
        is_new = all(
            np.abs(places[:, course] - places[:, other]).max() > 0.2 for other in different
        )
        if is_new and (room[course] >= 20 or len(different) < 3):
            different.append(int(course))
        if len(different) == POLICIES // len(LENGTHS):
            break
    begins = [
        (course, left) for left in LENGTHS for course in different if left <= max(room[course], 10)
    ]
    rows = [np.zeros(STEPS, np.int32), *(np.asarray(tools.courses[course]) for course, _ in begins)]
    lefts = [0, *(left for _, left in begins)]
    return {"course": jnp.asarray(np.stack(rows)), "left": jnp.asarray(lefts, jnp.int32)}


def settle(tools: Tools, start: Start) -> dict[str, Any]:
    """Answer the three questions about a start."""
    state = rows_of(starts_of(start.seed)[1], start.number)
    robots = state.pursuer, state.evader
    room, gap = (
        np.asarray(leaf) for leaf in rooms(tools.game, tools.reach, tools.courses, *robots)
    )
    memories = policies(tools, robots, room + gap)
    lasts = survive(tools.planner, robots, memories, SHORT, seed=1)
    longest = np.argsort(-lasts, kind="stable")[:2]
    survivors = [int(number) for number in longest if lasts[number] == SHORT]
    facts: dict[str, Any] = {
        "distance": round(
            float(jnp.hypot(robots[0].x - robots[1].x, robots[0].y - robots[1].y)), 2
        ),
        "lost_after": start.lost_after / 10,
        "room": round(float(room.max()) / 10, 1),
        "policies": len(lasts),
        "evader_lasts": float(lasts[0]) / 2,
        "best_lasts": float(lasts.max()) / 2,
        "survive_10_s": int(np.sum(lasts == SHORT)),
    }
    if survivors:
        numbers = np.repeat(survivors, REPEATS)
        long = survive(tools.thorough, robots, rows_of(memories, numbers), LONG, seed=2)
        least = long.reshape(-1, REPEATS).min(axis=1)
        facts["least_of_four"] = float(least.max()) / 2
        best = survivors[int(np.argmax(least))]
        course, left = np.asarray(memories["course"])[best], int(memories["left"][best])
        facts["policy"] = "".join(map(str, course[:left]))
    facts["answers"] = {}
    for width in WIDTHS:
        answers = search_answers(tools.pursuer, tools.reach, robots, width)
        facts["answers"][str(width)] = [answers.result, answers.levels / 2]
        if answers.result != "caught":
            break
    if facts["answers"][str(WIDTHS[0])][0] == "caught":
        game, evader = tools.planner.game, tools.planner.opponent
        facts["survive_matrix"] = survive_matrix(tools.pursuer, game, evader, robots, memories)
    facts["verdict"] = verdict(facts)
    return facts


def verdict(facts: dict[str, Any]) -> str:
    """Say what the answers mean."""
    caught = facts["answers"].get(str(WIDTHS[-1]), [""])[0] == "caught"
    caught = caught and facts["survive_matrix"] == 0
    if facts.get("least_of_four") == LONG / 2 and not caught:
        return "not forced"
    if caught and facts["survive_10_s"] == 0:
        return "forced"
    return "undecided"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--seeds", type=int, nargs="+", choices=range(5), default=[0, 1, 2, 3, 4])
    options = parser.parse_args()
    text = options.out.read_text(encoding="utf-8") if options.out.exists() else "{}"
    results = json.loads(text)
    tools = make_tools()
    for seed in options.seeds:
        print(f"seed {seed}: the planner plays", flush=True)
        for start in lost_starts(seed):
            if str(start) in results:
                continue
            results[str(start)] = settle(tools, start)
            print(start, results[str(start)], flush=True)
            options.out.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
