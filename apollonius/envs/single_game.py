"""One game under way behind one compiled call, for all interfaces of a single game."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import accumulate, pairwise, starmap
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, UInt8, UInt32

from apollonius.accelerate.bit_mixing import mix_bits
from apollonius.agents.pool import Pool
from apollonius.arenas.file import as_game
from apollonius.envs.batch import (
    CompiledFunction,
    ExternalPolicy,
    flatten_carry,
    require_unforked,
    restore_games,
    start_games,
)
from apollonius.envs.options import (
    ObservationOption,
    OwnReward,
    PlayerOption,
    RewardOption,
    action_space,
    as_actions,
    make_contest,
    observation_space,
)
from apollonius.game.game import Game
from apollonius.game.types import (
    BySide,
    GameState,
    MoverStates,
    Outcome,
    RandomBits,
    RobotStatus,
    Role,
)
from apollonius.io.errors import require
from apollonius.play.replay import as_state
from apollonius.play.rollout import observe_both, step_games
from apollonius.show.canvas import Canvas

# A game is one row of numbers: for each robot x, y, speed, heading, status and reward; whether the
# game was terminated, whether it was truncated, and its outcome; then the observations of robots
# from outside.
_STATUS = 4
"""Column of a robot's status."""
_REWARD = 5
"""Column of its reward."""
_COLUMNS = 6
"""Number of columns of a robot."""
RENDER_MODES = ["rgb_array"]
_OUTCOMES = [outcome.name.lower() for outcome in Outcome]

_Carry = tuple[MoverStates | None, tuple[Array, ...]]
"""The movers of a game, and the arrays of `flatten_carry`."""


class SingleGame:
    """One game, one step at a time, either side's actions from outside or from a player of the
    package (`inside`).

    It pickles, before its first reset as well as under way. The numbers of a game, before and after
        a step, are one
    array: passing each costs several times the step. Actions are `discrete` or `continuous`, shares
        of the largest
    acceleration and turn rate in [-1, 1]; the render mode is `rgb_array`, or None.
    """

    def __init__(
        self,
        game: Game | str,
        observation: ObservationOption,
        actions: str,
        render_mode: str | None,
        reward: RewardOption,
        inside: Mapping[Role, PlayerOption],
    ) -> None:
        require_unforked()
        require(
            render_mode in (None, *RENDER_MODES),
            "render_mode",
            render_mode,
            f"{RENDER_MODES[0]}, or None",
        )
        game = as_game(game)
        game.require_one_arena("an environment of a single game")
        contest = make_contest(game, observation, actions, reward, inside)
        self.game = game = contest.game
        self.observation_space = observation_space(contest.reads)
        self.action_space = action_space(actions)
        self.frames_per_second = max(1, round(1 / float(game.dt)))
        self.places = [(role, number) for role in Role for number in range(len(game.bodies[role]))]
        """Side and number of each robot, in the order of a game's robots."""
        self._end = _COLUMNS * len(self.places)
        sizes = [0 if role in inside else contest.reads.size for role, _ in self.places]
        self._seen = list(starmap(slice, pairwise(accumulate([self._end + 3, *sizes]))))
        self._kind = actions
        space = self.action_space
        self.idle = np.zeros(space.shape or (), space.dtype)
        """A placeholder for the action of a robot that is not played from outside."""
        # The game is a constant of both functions.
        self._start = CompiledFunction(_start, game, contest.players)
        self._step = CompiledFunction(_step, game, contest.players, contest.reward, self.idle.shape)
        self._device_row: Array | None = None
        self._canvas = Canvas(game) if render_mode else None

    @property
    def is_running(self) -> bool:
        return self._device_row is not None and not (self.terminated or self.truncated)

    def reset(self, bits: np.uint32) -> None:
        """Begin a new game; random bits decide where."""
        require_unforked()
        self._steps = 0
        self._canvas = Canvas(self.game) if self._canvas else None
        numbers, self._carried = self._start(bits)
        self._take(numbers)

    def step(self, actions: Sequence[Any], bits: np.uint32) -> None:
        """Let all robots hold their actions, pursuers first, for one step; those of a side inside
        are ignored.

        Raises InvalidInput for an impossible action. A player inside uses the random bits.
        """
        action_arrays = [as_actions(action, self._kind) for action in actions]
        step_inputs = np.empty(1 + self.idle.size * len(action_arrays), action_arrays[0].dtype)
        step_inputs[0] = self._steps
        step_inputs[1:] = np.ravel(action_arrays)
        numbers, self._carried = self._step(self._device_row, step_inputs, bits, self._carried)
        self._steps += 1
        self._take(numbers)

    def _take(self, numbers: Array) -> None:
        self._device_row = numbers
        self._row = np.asarray(numbers)
        if self._canvas:
            active = [status == RobotStatus.ACTIVE for status in self.statuses]
            rows = self._row[: self._end].reshape(-1, _COLUMNS)
            self._canvas.move(rows[:, :_STATUS].ravel().tolist(), active, self._mover_places())

    def _mover_places(self) -> list[list[float]]:
        """Return x and y [m] of each mover."""
        movers, _ = self._carried
        if movers is None:
            return []
        return np.stack([movers.motion.x, movers.motion.y], axis=-1).tolist()

    def observation(self, robot: int) -> Float[np.ndarray, " size"]:
        """Return the observation of a robot from outside by its number among the game's robots."""
        return self._row[self._seen[robot]].copy()

    @property
    def rewards(self) -> list[float]:
        """Return the rewards of all robots for the last step."""
        return self._row[_REWARD : self._end : _COLUMNS].tolist()

    @property
    def statuses(self) -> list[int]:
        """Return the `RobotStatus` of all robots."""
        return self._row[_STATUS : self._end : _COLUMNS].astype(int).tolist()

    @property
    def terminated(self) -> bool:
        return bool(self._row[self._end])

    @property
    def truncated(self) -> bool:
        return bool(self._row[self._end + 1])

    @property
    def outcome(self) -> str:
        """Return `ongoing` or the name of a row of Tables II and III."""
        return _OUTCOMES[int(self._row[self._end + 2])]

    def picture(self) -> UInt8[np.ndarray, "height width 3"] | None:
        """Return the game as it stands, in mode `rgb_array`; otherwise None."""
        return np.array(self._canvas.picture()) if self._canvas else None


def _start(
    game: Game, players: BySide[Pool], bits: RandomBits
) -> tuple[Float[Array, " _"], _Carry]:
    """Return a game's numbers, and all else that it carries."""
    start = game.reset(jax.random.key(bits))
    games = start_games(game, players, jax.tree.map(lambda leaf: leaf[None], start))
    _, observations_by_side = observe_both(game, players, games, _bits_of(players, ~bits))
    outside = [role for role in Role if isinstance(players[role].members, ExternalPolicy)]
    observations = [observations_by_side[role][1] for role in outside]
    rewards = games.sides.map(lambda side: side.episode_return)
    numbers = _pack(games.state, rewards, [jnp.zeros(())] * 3, observations)
    return numbers, (start.movers, flatten_carry(games, players))


def _bits_of(players: BySide[Pool], bits: RandomBits) -> UInt32[Array, "2 1"]:
    """Return random bits of each side, those given for a player inside."""
    outside = [isinstance(pool.members, ExternalPolicy) for pool in players]
    sides = [
        mix_bits(bits, jnp.uint32(1 + number)) if out else bits
        for number, out in enumerate(outside)
    ]
    return jnp.stack(sides)[:, None]


def _step(
    game: Game,
    players: BySide[Pool],
    reward: OwnReward | None,
    shape: tuple[int, ...],
    numbers: Float[Array, " numbers"],
    step_inputs: Int[Array, " inputs"] | Float[Array, " inputs"],
    bits: RandomBits,
    carried: _Carry,
) -> tuple[Float[Array, " numbers"], _Carry]:
    """Step a game; return its numbers and all else.

    `step_inputs` are the number of the step and the actions, each of this shape, of all robots.
    """
    counts = game.bodies.map(len)
    rows = numbers[: _COLUMNS * sum(counts)].reshape(-1, _COLUMNS)
    state = as_state(rows[:, :_STATUS].ravel(), step_inputs[0].astype(jnp.int32), counts.pursuer)
    statuses = tuple(rows[:, _STATUS].astype(jnp.int32))
    sides = BySide(statuses[: counts.pursuer], statuses[counts.pursuer :])
    movers, leaves = carried
    state = replace(state, status=sides, movers=movers)
    actions = BySide(
        *jnp.split(step_inputs[1:].reshape(1, sum(counts), *shape), [counts.pursuer], axis=1)
    )
    games = restore_games(
        game, players, jax.tree.map(lambda leaf: leaf[None], state), leaves, actions
    )
    games, transitions = step_games(game, players, games, _bits_of(players, bits), pay=reward)
    outside = [role for role in Role if isinstance(players[role].members, ExternalPolicy)]
    next_observations = [transitions.sides[role].next_observation for role in outside]
    ends = [transitions.terminated, transitions.truncated, transitions.outcome]
    rewards = transitions.sides.map(lambda side: side.reward)
    numbers_after = _pack(games.state, rewards, ends, next_observations)
    movers_after = jax.tree.map(lambda leaf: leaf[0], games.state.movers)
    return numbers_after, (movers_after, flatten_carry(games, players))


def _pack(
    state: GameState, rewards: BySide[Array], ends: Sequence[Array], observations: Sequence[Array]
) -> Float[Array, " numbers"]:
    robots = [
        number
        for role in Role
        for parts in zip(
            state.robots[role], state.status[role], jnp.unstack(rewards[role].ravel()), strict=True
        )
        for number in jax.tree.leaves(parts)
    ]
    parts = (*robots, *ends, *observations)
    return jnp.concatenate([jnp.ravel(part).astype(jnp.float32) for part in parts])
