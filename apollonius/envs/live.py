"""Spaces of observations and actions, and one game under way behind one compiled call, for all interfaces."""

import inspect
from collections.abc import Sequence
from dataclasses import replace
from itertools import accumulate, pairwise, starmap
from typing import Any

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, UInt8, UInt32

from apollonius.agents.policy import mixed
from apollonius.agents.pool import Pool, solo
from apollonius.arenas.charting import charted
from apollonius.arenas.file import as_game
from apollonius.catalogue import find_player
from apollonius.envs.batch import Compiled, Outside, begun, carried, require_unforked, resumed
from apollonius.game.game import Game
from apollonius.game.types import NUM_ACTIONS, ROLES, Bits, BySide, GameState, Outcome, RobotStatus, Role
from apollonius.io.errors import require
from apollonius.observe.registry import find_observation
from apollonius.play.replay import as_state
from apollonius.play.rollout import look_around, step_games
from apollonius.show.canvas import Canvas

_STATUS, _REWARD, _COLUMNS = 4, 5, 6
"""Columns of a robot's row of numbers, after x, y, v, heading, and how many there are. After the rows of all robots
come whether the game was terminated, whether it was truncated, and its outcome, then the observations of those from
outside."""
RENDER_MODES = ["rgb_array"]
_OUTCOMES = [outcome.name.lower() for outcome in Outcome]


def as_role(given: object) -> Role:
    """Return a side, or that of a name, which an environment's specification in JSON has; raises InvalidInput."""
    sides = {str(role).lower(): role for role in Role}
    require(str(given).lower() in sides, "role", given, f"one of {', '.join(sides)}")
    return sides[str(given).lower()]


def require_known(environment: type, unknown: dict[str, Any]) -> None:
    """Refuse arguments that an environment does not have."""
    names = list(inspect.signature(environment).parameters)[:-1]
    for name, value in unknown.items():
        require(False, name, value, f"left out: the arguments are {', '.join(names)}")


def require_no_options(options: dict[str, Any] | None) -> None:
    """Refuse options of a reset."""
    require(not options, "options", options, "left out, as this environment has none")


def observation_space(observation: str) -> gymnasium.spaces.Box:
    """Return the space of a robot's observations; raises InvalidInput if they are unknown.

    They are within 2 of 0 unless a robot goes half an arena beyond the walls in one step.
    """
    return gymnasium.spaces.Box(-2.0, 2.0, (find_observation(observation).size,), np.float32)


def action_space(actions: str) -> gymnasium.spaces.Space[Any]:
    """Return the space of a robot's actions of a kind; raises InvalidInput if it is unknown."""
    require(actions in ("discrete", "continuous"), "actions", actions, "one of discrete, continuous")
    continuous = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)
    return continuous if actions == "continuous" else gymnasium.spaces.Discrete(NUM_ACTIONS)


def seated(game: Game, observation: str, actions: str, inside: dict[Role, str]) -> tuple[Game, BySide[Pool]]:
    """Return a game with a chart if anybody reads one, and who plays it: players of the package by their names, and
    `Outside` on the other sides.
    """
    reads, found = find_observation(observation), {role: find_player(inside[role], role, game) for role in inside}
    first = jnp.zeros((), jnp.int32) if actions == "discrete" else jnp.zeros(2)
    players = ROLES.map(lambda role: solo(found[role].policy if role in found else Outside(first, reads)))
    return charted(game, reads.charted or any(one.policy.charted for one in found.values())), players


def as_actions(given: Any, kind: str, batch: tuple[int, ...] = ()) -> np.ndarray:
    """Return one action of a kind, or a batch, in its number type; raises InvalidInput for what is not in the space."""
    discrete = kind == "discrete"
    name, numbers = "actions" if batch else "action", "a whole number" if discrete else "numbers"
    shape = batch if discrete else (*batch, 2)
    least, most = (0, NUM_ACTIONS - 1) if discrete else (-1, 1)
    try:
        actions = np.asarray(given)
    except ValueError:  # of lists of several lengths
        actions = np.asarray(None)
    # A message costs as much as a step of the game.
    if actions.dtype.kind not in ("iu" if discrete else "iuf"):
        require(False, name, given, f"{numbers} from {least} to {most}")
    if actions.shape != shape:
        require(False, f"shape of {name}", actions.shape, str(shape))
    low, high = (actions.min(), actions.max()) if shape else (actions, actions)
    if not (least <= low and high <= most):
        require(False, name, low if low == high else f"{low} to {high}", f"from {least} to {most}")
    return actions.astype(np.int32 if discrete else np.float32)


def random_bits(random: np.random.Generator) -> np.uint32:
    return np.uint32(random.integers(2**32, dtype=np.uint64))


class LiveGame:
    """One game, one step at a time, either side's actions from outside or from a player of the package (`inside`).

    It pickles, before its first reset as well as under way. The numbers of a game, before and after a step, are one
    array: passing each costs several times the step. Actions are `discrete` or `continuous`, shares of the largest
    acceleration and turn rate in [-1, 1]; the render mode is `rgb_array`, or None.
    """

    def __init__(
        self, game: Game | str, observation: str, actions: str, render_mode: str | None, inside: dict[Role, str]
    ) -> None:
        require_unforked()
        require(render_mode in (None, *RENDER_MODES), "render_mode", render_mode, f"{RENDER_MODES[0]}, or None")
        game = as_game(game)
        game.require_one_arena("an environment of a single game")
        game, players = seated(game, observation, actions, inside)
        self.game = game
        self.frames_per_second = max(1, round(1 / float(game.dt)))
        self.places = [(role, number) for role in Role for number in range(len(game.bodies[role]))]
        """Side and number of each robot, in the order of a game's robots."""
        self._end = _COLUMNS * len(self.places)
        sizes = [0 if role in inside else find_observation(observation).size for role, _ in self.places]
        self._seen = list(starmap(slice, pairwise(accumulate([self._end + 3, *sizes]))))
        self._kind, space = actions, action_space(actions)
        self.idle = np.zeros(space.shape or (), space.dtype)
        """A placeholder for the action of a robot that is not played from outside."""
        # The game is a constant of both functions.
        self._begin, self._step = Compiled(_begin, game, players), Compiled(_step, game, players, self.idle.shape)
        self._numbers: Array | None = None
        self._canvas = Canvas(game) if render_mode else None

    @property
    def is_under_way(self) -> bool:
        return self._numbers is not None and not (self.terminated or self.truncated)

    def reset(self, bits: np.uint32) -> None:
        """Begin a new game; random bits decide where."""
        require_unforked()
        self._steps = 0
        self._canvas = Canvas(self.game) if self._canvas else None
        numbers, self._carried = self._begin(bits)
        self._take(numbers)

    def step(self, actions: Sequence[Any], bits: np.uint32) -> None:
        """Let all robots hold their actions, pursuers first, for one step; those of a side inside are ignored.

        Raises InvalidInput for an impossible action. A player inside uses the random bits.
        """
        checked = [as_actions(action, self._kind) for action in actions]
        given = np.empty(1 + self.idle.size * len(checked), checked[0].dtype)
        given[0], given[1:] = self._steps, np.ravel(checked)
        numbers, self._carried = self._step(self._numbers, given, bits, self._carried)
        self._steps += 1
        self._take(numbers)

    def _take(self, numbers: Array) -> None:
        self._numbers, self._read = numbers, np.asarray(numbers)
        if self._canvas:
            active = [status == RobotStatus.ACTIVE for status in self.statuses]
            rows = self._read[: self._end].reshape(-1, _COLUMNS)
            self._canvas.move(rows[:, :_STATUS].ravel().tolist(), active)

    def observation(self, robot: int) -> Float[np.ndarray, " size"]:
        """Return the observation of a robot from outside by its number among the game's robots."""
        return self._read[self._seen[robot]].copy()

    @property
    def rewards(self) -> list[float]:
        """Return the rewards of all robots for the last step."""
        return self._read[_REWARD : self._end : _COLUMNS].tolist()

    @property
    def statuses(self) -> list[int]:
        """Return the `RobotStatus` of all robots."""
        return self._read[_STATUS : self._end : _COLUMNS].astype(int).tolist()

    @property
    def terminated(self) -> bool:
        return bool(self._read[self._end])

    @property
    def truncated(self) -> bool:
        return bool(self._read[self._end + 1])

    @property
    def outcome(self) -> str:
        """Return `ongoing` or the name of a row of Tables II and III."""
        return _OUTCOMES[int(self._read[self._end + 2])]

    def picture(self) -> UInt8[np.ndarray, "height width 3"] | None:
        """Return the game as it stands, in mode `rgb_array`; otherwise None."""
        return np.array(self._canvas.picture()) if self._canvas else None


def _begin(game: Game, players: BySide[Pool], bits: Bits) -> tuple[Float[Array, " _"], tuple[Array, ...]]:
    """Return a game's numbers, and what it carries."""
    games = begun(game, players, jax.tree.map(lambda leaf: leaf[None], game.reset(jax.random.key(bits))))
    _, seen = look_around(game, players, games, _bits_of(players, ~bits))
    observations = [seen[role][1] for role in Role if isinstance(players[role].members, Outside)]
    rewards = games.sides.map(lambda side: side.episode_return)
    return _packed(games.state, rewards, [jnp.zeros(())] * 3, observations), carried(games, players)


def _bits_of(players: BySide[Pool], bits: Bits) -> UInt32[Array, "2 1"]:
    """Return random bits of each side, those given for a player inside."""
    outside = [isinstance(pool.members, Outside) for pool in players]
    sides = [mixed(bits, jnp.uint32(1 + number)) if out else bits for number, out in enumerate(outside)]
    return jnp.stack(sides)[:, None]


def _step(
    game: Game, players: BySide[Pool], shape: tuple[int, ...], numbers: Float[Array, " numbers"],
    given: Int[Array, " given"] | Float[Array, " given"], bits: Bits, leaves: Sequence[Array],
) -> tuple[Float[Array, " numbers"], tuple[Array, ...]]:  # fmt: skip
    counts = game.bodies.map(len)
    rows = numbers[: _COLUMNS * sum(counts)].reshape(-1, _COLUMNS)
    state = as_state(rows[:, :_STATUS].ravel(), given[0].astype(jnp.int32), counts.pursuer)
    if state.status is not None:
        statuses = tuple(rows[:, _STATUS].astype(jnp.int32))
        state = replace(state, status=BySide(statuses[: counts.pursuer], statuses[counts.pursuer :]))
    actions = BySide(*jnp.split(given[1:].reshape(1, sum(counts), *shape), [counts.pursuer], axis=1))
    games = resumed(game, players, jax.tree.map(lambda leaf: leaf[None], state), leaves, actions)
    games, made = step_games(game, players, games, _bits_of(players, bits))
    seen = [made.sides[role].next_observation for role in Role if isinstance(players[role].members, Outside)]
    ends = [made.terminated, made.truncated, made.outcome]
    return _packed(games.state, made.sides.map(lambda side: side.reward), ends, seen), carried(games, players)


def _packed(
    state: GameState, rewards: BySide[Array], ends: Sequence[Array], seen: Sequence[Array]
) -> Float[Array, " numbers"]:
    statuses = state.status or state.robots.map(lambda side: (jnp.zeros(1),) * len(side))
    robots = [
        number
        for role in Role
        for parts in zip(state.robots[role], statuses[role], jnp.unstack(rewards[role].ravel()), strict=True)
        for number in jax.tree.leaves(parts)
    ]
    return jnp.concatenate([jnp.ravel(one).astype(jnp.float32) for one in (*robots, *ends, *seen)])
