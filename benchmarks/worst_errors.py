"""Shielded robots that know themselves with errors, chosen in every step by an adversary:
`python benchmarks/worst_errors.py OUT --pursuer shielded:intercept --evader shielded:flee`.

Within the bounds of `UNCERTAINTY` the adversary chooses the place, heading and speed that a robot
believes to have, and whether its command takes effect at once or a step late. In each game it is
one of three kinds: one takes the errors under which the robot thinks that it is farther from
obstacles, and slower; one draws extreme errors by chance; one tries `CANDIDATES` extremes and keeps
the worst, after which the best stop with exact knowledge would leave least clearance. Starts are at
rest.
"""

import argparse
import json
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from apollonius.agents.policy import AbstractPolicy, Memory
from apollonius.agents.wrappers.backup import Backup, brakes
from apollonius.agents.wrappers.shield import Shielded
from apollonius.arenas.charting import with_chart
from apollonius.arenas.file import find_game
from apollonius.catalogue import find_player
from apollonius.evaluate.statistics import wilson_interval
from apollonius.game.drive import MOST_LAG, Drive, Drives
from apollonius.game.dynamics import wrap_angle
from apollonius.game.game import Game, sample_starts
from apollonius.game.types import (
    ROLES,
    Action,
    BySide,
    DriveState,
    GameState,
    Outcome,
    RobotState,
    RobotStatus,
    Role,
    Scalar,
)
from apollonius.game.uncertainty import Uncertainties, Uncertainty
from apollonius.observe.knowledge import Knowledge
from apollonius.observe.view import Robot, view_of

UNCERTAINTY = Uncertainty(position=0.05, heading=0.05, speed=0.05, delay=0.1)
AWAY, CHANCE, WORST = "away from obstacles", "by chance", "the worst of several"
SHARES = {AWAY: 0.45, CHANCE: 0.45, WORST: 0.1}
"""Share of the games against each kind of adversary."""
CANDIDATES = 8
TOGETHER = 500
"""Games that are played at a time."""


class Side(NamedTuple):
    """A robot's memory and its latest command, and whether its start was inside the promise."""

    memory: Memory
    command: Array
    is_promised: Array


class Course(NamedTuple):
    """Games under way, and which sides have failed by themselves."""

    state: GameState
    sides: BySide[Side]
    outcome: Array
    failed: BySide[Array]


class Errors(NamedTuple):
    """What an adversary chooses: the state that a robot believes to be in, and whether its command
    is late."""

    believed: RobotState
    is_late: Array


def uncertain(game: Game) -> Game:
    """Return a game whose robots are uncertain of themselves, and whose commands are remembered."""
    drives = Drives(Drive(lag=0), Drive(lag=0))
    return replace(
        with_chart(game), drives=drives, uncertainty=Uncertainties(UNCERTAINTY, UNCERTAINTY)
    )


def errors_of(robot: RobotState, angle: Scalar, signs: Array) -> Errors:
    """Return extreme errors: of the place in a direction, of the others by their signs. No robot
    believes that it reverses.
    """
    heading, speed, late = signs
    believed = RobotState(
        x=robot.x + UNCERTAINTY.position * jnp.cos(angle),
        y=robot.y + UNCERTAINTY.position * jnp.sin(angle),
        v=jnp.maximum(robot.v + UNCERTAINTY.speed * speed, 0.0),
        heading=wrap_angle(robot.heading + UNCERTAINTY.heading * heading),
    )
    return Errors(believed, late > 0)


def away_from_obstacles(game: Game, robot: RobotState, late: Array) -> Errors:
    """Return the errors under which a robot thinks that it is farther from the nearest obstacle,
    heads away from it, and is slower."""
    clearance = game.arena.clearance(robot.x, robot.y)
    step = 1e-3
    gradient_x = game.arena.clearance(robot.x + step, robot.y) - clearance
    gradient_y = game.arena.clearance(robot.x, robot.y + step) - clearance
    away = jnp.arctan2(gradient_y, gradient_x)
    turn = jnp.where(wrap_angle(away - robot.heading) > 0, 1.0, -1.0)
    return errors_of(robot, away, jnp.stack([turn, -1.0, late]))


def main() -> None:
    """Play, and write the counts of each kind of adversary."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("--game", default="paper")
    parser.add_argument("--games", type=int, default=10_000)
    parser.add_argument("--pursuer", default="shielded:pursuer")
    parser.add_argument("--evader", default="shielded:evader")
    parser.add_argument("--max-steps", type=int, default=300)
    parser.add_argument(
        "--unaware", action="store_true", help="shields that take what they know for the truth"
    )
    options = parser.parse_args()
    game = replace(uncertain(find_game(options.game)), max_steps=options.max_steps)
    names = BySide(options.pursuer, options.evader)
    known_game = replace(game, uncertainty=None) if options.unaware else game
    players = ROLES.map(lambda role: find_player(names[role], role, known_game).policy)
    exact = ROLES.map(lambda role: brakes(replace(game, uncertainty=None), role))
    counts = {
        kind: play_kind(kind, round(share * options.games), game, known_game, players, exact)
        for kind, share in SHARES.items()
    }
    inside = sum(
        counts[kind][f"{side}: own failures inside the promise"]
        for kind in SHARES
        for side in ("pursuer", "evader")
    )
    low, high = wilson_interval(inside, 2 * options.games)
    record = {
        "game": options.game,
        "pursuer": options.pursuer,
        "evader": options.evader,
        "games": options.games,
        "max_steps": options.max_steps,
        "shields know the bounds": not options.unaware,
        "own failures of either inside the promise": inside,
        "share of robots' games [95 %]": [low, high],
        "by kind of adversary": counts,
    }
    options.out.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


def play_kind(
    kind: str,
    games: int,
    game: Game,
    known_game: Game,
    players: BySide[AbstractPolicy],
    exact: BySide[Backup],
) -> dict[str, int]:
    """Play games against one kind of adversary; return the counts of what happened.

    Args:
        kind: of the adversary.
        games: their number.
        game: the rules.
        known_game: the rules as the players know them.
        players: both sides.
        exact: stops of robots that know themselves exactly, by which an adversary judges.
    """
    starts = sample_starts(game, jax.random.key(7), games)
    counts = Counter[str]()
    for first in range(0, games, TOGETHER):
        rows = jax.tree.map(lambda leaf, first=first: leaf[first : first + TOGETHER], starts)
        key = jax.random.key(first)
        outcomes, failed, promised = play(game, known_game, players, exact, rows, kind, key)
        counts.update(Outcome(int(outcome)).name.lower() for outcome in outcomes)
        for role in ROLES:
            side = role.name.lower()
            counts[f"{side}: own failures inside the promise"] += int(
                (failed[role] & promised[role]).sum()
            )
            counts[f"{side}: own failures outside"] += int((failed[role] & ~promised[role]).sum())
            counts[f"{side}: starts outside the promise"] += int((~promised[role]).sum())
        print(kind, first + len(rows.steps), dict(counts), flush=True)
    return dict(counts)


@eqx.filter_jit
def play(
    game: Game,
    known_game: Game,
    players: BySide[AbstractPolicy],
    exact: BySide[Backup],
    starts: GameState,
    kind: str,
    key: Array,
) -> tuple[Array, BySide[Array], BySide[Array]]:
    """Play games against an adversary of this kind, by players that know `known_game`.

    Returns their outcomes and, of each side, whether it failed by itself, and whether its start was
    inside the promise of its shield.
    """

    exact_promises = players.map(
        lambda player: isinstance(player, Shielded) and player.backup.is_uncertain
    )

    count = len(starts.steps)

    def side_at_start(role: Role) -> Side:
        return Side(players[role].memory, jnp.zeros(2), jnp.ones((), bool))

    def command_of(
        role: Role, state: GameState, side: Side, believed: RobotState, bits: Array
    ) -> tuple[Action, Memory]:
        robots = BySide.of(role, (believed,), state.robots[role.other])
        drive = DriveState(jnp.zeros((MOST_LAG, 2)).at[0].set(side.command), None)
        knowledge = Knowledge.complete(replace(state, robots=robots), (drive,))
        player = players[role]
        view = view_of(known_game, knowledge, role)
        return player(player.observation(view), side.memory, bits)

    def robot_after(
        role: Role, robot: RobotState, side: Side, action: Action, is_late: Array
    ) -> tuple[RobotState, Array, Array]:
        body = game.bodies[role][0]
        command = jnp.stack(body.controls(action))
        executed = jnp.where(is_late, side.command, command)
        return body.move(robot, executed[0], executed[1], game.dt), command, executed

    def choose(
        role: Role, state: GameState, side: Side, key: Array
    ) -> tuple[Action, Memory, Array]:
        """Return the action, the memory after it and whether the command is late."""
        robot, body = state.robots[role][0], game.bodies[role][0]
        bits = jax.random.bits(key)
        tries = CANDIDATES if kind == WORST else 1
        angles = jax.random.uniform(key, (tries,), maxval=2 * jnp.pi)
        signs = jax.random.rademacher(jax.random.fold_in(key, 1), (tries, 3), jnp.float32)

        def try_errors(angle: Scalar, signs: Array) -> tuple[Action, Memory, Array, Scalar]:
            errors = errors_of(robot, angle, signs)
            if kind == AWAY:
                errors = away_from_obstacles(game, robot, signs[2])
            action, memory = command_of(role, state, side, errors.believed, bits)
            after, _, _ = robot_after(role, robot, side, action, errors.is_late)
            left = exact[role].clearance_after(Robot(body, after), jnp.int32(1))
            now = game.arena.clearance(after.x, after.y) - body.radius
            return action, memory, errors.is_late, jnp.minimum(left, now)

        *choices, lefts = jax.vmap(try_errors)(angles, signs)
        worst = jnp.argmin(lefts)
        action, memory, is_late = jax.tree.map(lambda leaf: leaf[worst], choices)
        return action, memory, is_late

    def one_step(before: Course, number: Array) -> tuple[Course, None]:
        step_keys = jax.random.split(jax.random.fold_in(key, number), count)

        def one_game(
            state: GameState, sides: BySide[Side], key: Array
        ) -> tuple[GameState, BySide[Side], Array]:
            def act(role: Role) -> tuple[Side, Array]:
                side = sides[role]
                own_key = jax.random.fold_in(key, role)
                action, memory, is_late = choose(role, state, side, own_key)
                robot = state.robots[role][0]
                _, command, executed = robot_after(role, robot, side, action, is_late)
                is_safe = memory[1] >= 0 if exact_promises[role] else side.is_promised
                promised = jnp.where(number == 0, is_safe, side.is_promised)
                return Side(memory, command, promised), executed

            acted = ROLES.map(act)
            controls = acted.map(lambda pair: ((pair[1][0], pair[1][1]),))
            after = game.step_controls(state, controls)
            return after.state, acted.map(lambda pair: pair[0]), after.outcome

        states, sides_after, outcomes = jax.vmap(one_game)(before.state, before.sides, step_keys)
        is_over = before.outcome != Outcome.ONGOING

        def keep(old: Array, new: Array) -> Array:
            return jnp.where(is_over.reshape(-1, *[1] * (new.ndim - 1)), old, new)

        fell = states.status.map(
            lambda side: (
                (side[0] == RobotStatus.HIT_OBSTACLE) | (side[0] == RobotStatus.OUT_OF_RANGE)
            )
        )
        after = Course(
            state=jax.tree.map(keep, before.state, states),
            sides=jax.tree.map(keep, before.sides, sides_after),
            outcome=keep(before.outcome, outcomes),
            failed=jax.tree.map(lambda old, new: old | (new & ~is_over), before.failed, fell),
        )
        return after, None

    sides = jax.tree.map(
        lambda leaf: jnp.broadcast_to(leaf, (count, *jnp.shape(leaf))), ROLES.map(side_at_start)
    )
    nobody = ROLES.map(lambda role: jnp.zeros(count, bool))
    ongoing = jnp.full(count, Outcome.ONGOING, jnp.int32)
    start = Course(starts, sides, ongoing, nobody)
    end, _ = jax.lax.scan(one_step, start, jnp.arange(game.max_steps))
    return end.outcome, end.failed, end.sides.map(lambda side: side.is_promised)


if __name__ == "__main__":
    main()
