"""The course of one game, and replays: files of games that play again to the same bits."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Float32, Int, PRNGKeyArray, Shaped

from apollonius.agents.pool import Pool
from apollonius.arenas.file import from_dict, to_dict
from apollonius.game.dynamics import stack_actions
from apollonius.game.game import Game
from apollonius.game.judge import statuses_along
from apollonius.game.types import (
    NUM_ACTIONS,
    ROLES,
    BySide,
    DriveStates,
    GameState,
    MoverStates,
    Outcome,
    RobotState,
)
from apollonius.game.validation import MAX_SIZE
from apollonius.io.document import parse_json, read_bytes, to_json, write_atomically
from apollonius.io.errors import require, require_printable
from apollonius.io.limits import MOST_COUNTED, SEED
from apollonius.play.playout import AbstractWatcher, play_out
from apollonius.play.rollout import Transition, drives_at_start, step_driven

FORMAT = 1
"""Version of the file format."""
_MOST_BYTES = 2**26
"""Largest file [bytes]: a game of some 400,000 steps."""

AllActions = Int[Array, "steps robots"] | Float[Array, "steps robots 2"]
"""Actions of the pursuers and then of the evaders in every step: 0..8, or the action levels of all
where one side's are continuous. A discrete action moves a robot by its levels to the same bits."""


class Trajectory(eqx.Module):
    """One game: its states, leaves `[steps + 1]`, all robots' actions, and how it ended."""

    states: GameState
    actions: AllActions
    outcome: Int[Array, ""]


class _Recorder(AbstractWatcher):
    """The number of steps of a game, and all robots' actions in them; at first zeros for the
    longest game.
    """

    actions: AllActions

    def init(self) -> tuple[Int[Array, ""], AllActions]:
        return jnp.zeros((), jnp.int32), self.actions

    def update(
        self, statistic: tuple[Int[Array, ""], AllActions], transition: Transition
    ) -> tuple[Int[Array, ""], AllActions]:
        step, actions = statistic
        robot_actions: list[Array] = []
        for side in transition.sides:
            robot_actions += list(side.action) if side.reward.ndim else [side.action]
        return step + 1, actions.at[step].set(stack_actions(*robot_actions))


def trace(
    game: Game, players: BySide[Pool], starts: GameState, key: PRNGKeyArray, index: int
) -> Trajectory:
    """Return the course of one of the games that `play_out` plays with the same arguments.

    Args:
        game: the rules.
        players: the players of both sides.
        starts: initial states of all games, leaves `[games]`.
        key: draws the random bits; it is consumed.
        index: which of the games.
    """
    start = jax.tree.map(lambda leaf: np.asarray(leaf)[index : index + 1], starts)
    shape = int(game.max_steps), sum(len(side) for side in start.robots)
    continuous = any(pool.members.continuous for pool in players)
    blank = np.zeros((*shape, 2), np.float32) if continuous else np.zeros(shape, np.int32)
    results = play_out(
        game, players, start, key, slots=1, watcher=_Recorder(jax.device_put(blank)), first=index
    )
    actions, steps = results.watched[1][0], int(results.steps[0])
    single = jax.device_put(jax.tree.map(lambda leaf: leaf[0], start))
    states, outcomes = jax.device_get(play_actions(game, single, actions))
    return Trajectory(
        states=jax.device_put(jax.tree.map(lambda leaf: leaf[: steps + 1], states)),
        actions=jax.device_put(np.asarray(actions)[:steps]),
        outcome=jax.device_put(outcomes[steps - 1]),
    )


@jax.jit
def play_actions(
    game: Game, start: GameState, actions: AllActions
) -> tuple[GameState, Int[Array, " steps"]]:
    """Play recorded actions; return all states, leaves `[steps + 1]`, and each step's outcome."""
    unpaid = replace(game, reward=replace(game.reward, along_paths=False))  # needs no charts
    pursuers = len(start.robots.pursuer)
    drives = ROLES.map(lambda role: drives_at_start(game, start, role))

    def one_step(
        now: tuple[GameState, BySide[DriveStates]], action: Shaped[Array, "robots ..."]
    ) -> tuple[tuple[GameState, BySide[DriveStates]], tuple[GameState, Int[Array, ""]]]:
        state, drives = now
        sides = BySide(tuple(action[:pursuers]), tuple(action[pursuers:]))
        after, drives = step_driven(unpaid, state, drives, sides)
        return (after.state, drives), (after.state, after.outcome)

    _, (states, outcomes) = jax.lax.scan(one_step, (start, drives), actions)
    all_states = jax.tree.map(
        lambda first, rest: jnp.concatenate([first[None], rest]), start, states
    )
    return all_states, outcomes


@jax.jit
def _with_movers(game: Game, states: GameState, start: MoverStates) -> GameState:
    """Return recorded states, leaves `[rows]`, with the movers that go beside their robots.

    Args:
        game: the rules.
        states: the states without movers.
        start: the movers beside the first state.
    """

    def one_step(now: MoverStates, state: GameState) -> tuple[MoverStates, GameState]:
        state = replace(state, movers=now)
        assert game.movers is not None, "the game has some"
        return game.movers.step(game.at(state).arena, state, game.bodies, game.dt), state

    return jax.lax.scan(one_step, start, states)[1]


@dataclass(frozen=True)
class Replay:
    """A game that was played, with all that it takes to play it again.

    Attributes:
        seed, games, index: the match, and which of its games this is.
        states: of all robots, x [m], y [m], v [m/s], heading [rad] of each pursuer, then of each
            evader.
        actions: of the pursuers and the evaders, 0..8; or the action levels of all, where one
            side's are continuous.
        movers: the movers at the start; None in a game without any.
        tolerance: of the states of the game played again [m, m/s, rad]: 0 where these rules
            recorded it, more for a program that rounds otherwise.
    """

    game: Game
    pursuer: str
    evader: str
    seed: int
    games: int
    index: int
    states: Float32[np.ndarray, "rows numbers"]
    actions: Int[np.ndarray, "steps robots"] | Float32[np.ndarray, "steps robots 2"]
    outcome: Outcome
    tolerance: float = 0.0
    movers: MoverStates | None = None

    def first_difference(self) -> int | None:
        """Return the first step whose state differs when the game is played again, None where all
        are the same.

        The number of steps stands for an outcome that differs where no state does.
        """
        start = as_state(jnp.asarray(self.states[0]), jnp.asarray(0), len(self.game.bodies.pursuer))
        start = replace(start, movers=self.movers)
        states, outcomes = play_actions(self.game, start, jnp.asarray(self.actions))
        errors = np.abs(as_rows(states) - self.states)
        # headings of -pi and pi are the same
        errors[:, 3::4] = np.minimum(errors[:, 3::4], 2 * np.pi - errors[:, 3::4])
        differs = np.any(errors > self.tolerance, axis=1)
        if differs.any():
            return int(np.argmax(differs))
        return None if int(outcomes[-1]) == self.outcome else len(self.actions)

    def mover_places(self) -> Float32[np.ndarray, "rows movers 2"]:
        """Return x and y [m] of all movers in each state; of none in a game without them."""
        movers = self._states().movers
        if movers is None:
            return np.zeros((len(self.states), 0, 2), np.float32)
        return np.stack([np.asarray(movers.motion.x), np.asarray(movers.motion.y)], axis=-1)

    def _states(self) -> GameState:
        """Return the recorded states, in which all robots are active, with the movers beside
        them.
        """
        pursuers = len(self.game.bodies.pursuer)
        as_states = jax.vmap(as_state, (0, 0, None))
        states = as_states(jnp.asarray(self.states), jnp.arange(len(self.states)), pursuers)
        return states if self.movers is None else _with_movers(self.game, states, self.movers)

    def trajectory(self) -> Trajectory:
        """Return the game as it was recorded."""
        states = self._states()
        status = statuses_along(self.game, states)
        states = jax.vmap(lambda state, status: replace(state, status=status))(states, status)
        return Trajectory(states, jnp.asarray(self.actions), jnp.asarray(int(self.outcome)))

    def in_play(self) -> Bool[np.ndarray, "rows robots"]:
        """Return for each state which robots are drawn as in play; in a game of two both, to the
        end.
        """
        if self.game.teams is None:
            return np.ones((len(self.states), 2), bool)
        return np.stack(
            [np.asarray(robot) for side in self.trajectory().states.active for robot in side],
            axis=-1,
        )

    def ending(self) -> str:
        """Describe the end of the game, as `captured after 12.3 s`."""
        outcome = self.outcome.name.lower().replace("_", " ")
        return f"{outcome} after {len(self.actions) * float(self.game.dt):.1f} s"


def as_rows(states: GameState) -> Float32[np.ndarray, "rows numbers"]:
    """Return states as rows of 4 numbers for each robot."""
    return np.stack([np.asarray(leaf) for leaf in jax.tree.leaves(states.robots)], axis=-1)


def as_state(
    row: Float32[Array, " numbers"], steps: Int[Array, ""], pursuers: int = 1
) -> GameState:
    """Return the state of a row of 4 numbers for each robot, pursuers first, after some steps; all
    are active.
    """
    robots = tuple(RobotState(*row[first : first + 4]) for first in range(0, len(row), 4))
    return replace(GameState.at_start(BySide(robots[:pursuers], robots[pursuers:])), steps=steps)


def as_data(replay: Replay) -> dict[str, Any]:
    """Return a replay as JSON-like data, without loss of bits."""
    arrays = {"actions": replay.actions.tolist(), "states": replay.states.astype(float).tolist()}
    outcome = replay.outcome.name.lower()
    fields = {"format": FORMAT, "game": to_dict(replay.game), "outcome": outcome}
    data = {key: value for key, value in vars(replay).items() if value is not None}
    if replay.movers is not None:
        arrays["movers"] = [np.asarray(leaf).tolist() for leaf in jax.tree.leaves(replay.movers)]
    return data | fields | arrays


def save_replay(replay: Replay, path: Path) -> None:
    """Write a replay as JSON, atomically."""
    write_atomically(path, to_json(as_data(replay)).encode())


def load_replay(path: Path) -> Replay:
    """Return the replay of a file; raises InvalidInput where it is missing or cannot have been
    played.
    """
    content = read_bytes(path, "a replay", "check the path", _MOST_BYTES)
    data = parse_json(content, f"'{path}' is no replay; record it again")
    version = data.get("format")
    require(version == FORMAT, f"'{path}': format", version, f"{FORMAT}, as this version reads")
    record = from_dict(_Record, data, f"'{path}' is no replay")
    actions = _numbers(record.actions, f"'{path}': actions")
    states = _numbers(record.states, f"'{path}': states")
    discrete = actions.ndim < 3
    require(
        actions.dtype.kind == "i" or not discrete, f"'{path}': actions", "some", "whole numbers"
    )
    game = from_dict(Game, record.game, f"'{path}'")
    robots = sum(map(len, game.bodies))
    shape = (len(actions), robots) if discrete else (len(actions), robots, 2)
    states_shape = (len(actions) + 1, 4 * robots)
    shapes_fit = states.shape == states_shape and actions.shape == shape and len(actions)
    bound = f"a row of {4 * robots} more than actions"
    require(shapes_fit, f"'{path}': states", states.shape, bound)
    least, most = (0, NUM_ACTIONS - 1) if discrete else (-1, 1)
    actions_fit = (actions >= least).all() and (actions <= most).all()
    in_bounds = actions_fit and (np.abs(states) <= MAX_SIZE).all()
    require(
        in_bounds,
        f"'{path}': actions, states",
        "some",
        f"from {least} to {most}, and within {MAX_SIZE:g} of 0",
    )
    outcome = Outcome[record.outcome.upper()]
    match = record.pursuer, record.evader, record.seed, record.games, record.index
    actions = actions.astype(np.int32 if discrete else np.float32)
    movers = _movers_at_start(record.movers, game, f"'{path}': movers")
    numbers = states.astype(np.float32), actions
    return Replay(game, *match, *numbers, outcome, record.tolerance, movers)


def _movers_at_start(numbers: list[Any] | None, game: Game, name: str) -> MoverStates | None:
    """Return the movers of a file, the numbers of each field of `MoverStates`; refuse others than
    those of the game. The name is for messages.
    """
    fits = (numbers is None) == (game.movers is None)
    require(fits, name, numbers and "some", "in games with movers, and in no others")
    if numbers is None:
        return None
    leaves, structure = jax.tree.flatten(jax.eval_shape(game.reset, jax.random.key(0)).movers)
    rows = [_numbers(row, name) for row in numbers]
    fits = [row.shape for row in rows] == [leaf.shape for leaf in leaves]
    require(fits, name, "some", f"{len(leaves)} lists of numbers, as many as movers")
    *reals, bits = rows
    in_bounds = all((np.abs(row) <= MAX_SIZE).all() for row in reals)
    in_bounds = in_bounds and ((bits >= 0) & (bits < 2**32)).all()
    require(in_bounds, name, "some", f"within {MAX_SIZE:g} of 0, and bits of 32 as one number")
    pairs = zip(rows, leaves, strict=True)
    return structure.unflatten([jnp.asarray(row.astype(leaf.dtype)) for row, leaf in pairs])


@dataclass(frozen=True)
class _Record:
    """A replay as its file has it."""

    format: int
    game: dict[str, Any]
    pursuer: str
    evader: str
    seed: int
    games: int
    index: int
    outcome: str
    actions: list[Any]
    states: list[Any]
    tolerance: float = 0.0
    movers: list[Any] | None = None

    def __post_init__(self) -> None:
        for name in (self.pursuer, self.evader):
            require_printable("player", name)
        SEED.require("seed", self.seed)
        require(
            0 <= self.index < self.games <= MOST_COUNTED,
            "index",
            self.index,
            f"below games = {self.games}",
        )
        require(
            self.outcome.upper() in Outcome.__members__,
            "outcome",
            self.outcome,
            "how a game can end",
        )
        require(0 <= self.tolerance <= 1, "tolerance", self.tolerance, "from 0 to 1")


def _numbers(data: list[Any], name: str) -> np.ndarray:
    """Return nested lists of numbers as an array; refuse strings and booleans."""
    try:
        array = np.array(data)
    except ValueError:  # lists of different lengths
        array = np.array(None)
    require(array.dtype.kind in "if", name, "some", "numbers")
    return array
