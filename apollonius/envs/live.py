"""Spaces of observations and actions, and one game under way behind one compiled call, for all interfaces."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise, starmap
from typing import Any

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, UInt8, UInt32

from apollonius.agents.policy import AbstractPolicy, Memory, mixed
from apollonius.arenas.charting import charted
from apollonius.arenas.file import as_game
from apollonius.catalogue import find_player
from apollonius.envs.batch import Compiled, require_unforked
from apollonius.game.by_side import BySide
from apollonius.game.game import Game
from apollonius.game.sensing import DriveStates, drive_of
from apollonius.game.types import NUM_ACTIONS, ROLES, Action, GameState, Outcome, RobotStatus, Role
from apollonius.io.errors import require
from apollonius.observe import tracking
from apollonius.observe.registry import find_observation
from apollonius.observe.tracking import Track
from apollonius.observe.view import look
from apollonius.play.replay import as_state
from apollonius.play.rollout import bits_of_team, step_driven
from apollonius.show.canvas import Canvas

_STATUS, _REWARD, _COLUMNS = 4, 5, 6
"""Columns of a robot's row of numbers, after x, y, v, heading, and how many there are. After the rows of all robots
come whether the game was terminated, whether it was truncated, and its outcome, then the observations of all."""
RENDER_MODES = ["rgb_array"]
_OUTCOMES = [outcome.name.lower() for outcome in Outcome]


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


class LiveGame:
    """One game, one step at a time, either side's actions from outside or from a player of the package.

    It pickles, before its first reset as well as under way. The numbers of a game, before and after a step, are one
    array: passing each costs several times the step.

    Args:
        game: the rules, the name of a game, or its `.toml` or `.json` file.
        observation: name of what all robots see (`apollonius.observe.registry`).
        actions: `discrete`, or `continuous`: shares of the largest acceleration and turn rate in [-1, 1].
        render_mode: `rgb_array` for pictures from `render`, or None.
        inside: the name of the player of each side that is not played from outside.
    """

    def __init__(
        self, game: Game | str, observation: str, actions: str, render_mode: str | None,
        inside: dict[Role, str] | None = None,
    ) -> None:  # fmt: skip
        require_unforked()
        require(render_mode in (None, *RENDER_MODES), "render_mode", render_mode, f"{RENDER_MODES[0]}, or None")
        reads, game = find_observation(observation), as_game(game)
        game.require_one_arena("an environment of a single game")
        players = {role: find_player(name, role, game).policy for role, name in (inside or {}).items()}
        self.game = game = charted(game, reads.charted or any(one.charted for one in players.values()))
        self.frames_per_second = max(1, round(1 / float(game.dt)))
        self.places = [(role, number) for role in Role for number in range(len(game.bodies[role]))]
        """Side and number of each robot, in the order of a game's robots."""
        self._end = _COLUMNS * len(self.places)
        ends = [self._end + 3 + reads.size * number for number in range(len(self.places) + 1)]
        self._seen = list(starmap(slice, pairwise(ends)))
        self._kind, space = actions, action_space(actions)
        self.idle = np.zeros(space.shape or (), space.dtype)
        """A placeholder for the action of a robot that is not played from outside."""
        # The game is a constant of both functions.
        self._begin = Compiled(_begin, game, observation, players)
        self._step = Compiled(_step, game, observation, players, self.idle.shape)
        self._carried, self._steps = list[Array](), 0
        self._numbers: Array | None = None
        self._canvas = Canvas(game) if render_mode else None

    @property
    def begun(self) -> bool:
        return self._numbers is not None

    def reset(self, bits: np.uint32) -> None:
        """Begin a new game; random bits decide where."""
        require_unforked()
        self._steps = 0
        self._canvas = Canvas(self.game) if self._canvas else None
        numbers, self._carried = self._begin(bits)
        self._take(numbers)

    def step(self, actions: Sequence[Any], bits: np.uint32) -> None:
        """Let all robots hold their actions for one step; those of a side played from inside are ignored.

        Args:
            actions: of each pursuer and each evader, all of the kind of this game's actions.
            bits: random bits for a player inside.

        Raises:
            InvalidInput: for an impossible action.
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
        """Return the observation of a robot by its number among the game's robots."""
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


Carried = tuple[dict[Role, list[Memory]], BySide[Track | None], BySide[DriveStates]]
"""The state of a game besides its numbers: memories of the players inside, tracks of both sides, all drives."""


def _first(game: Game, players: dict[Role, AbstractPolicy], state: GameState) -> Carried:
    memory = {role: [player.memory] * len(game.bodies[role]) for role, player in players.items()}
    drives = ROLES.map(lambda role: (drive_of(game.drives, role).begin(),) * len(game.bodies[role]))
    return memory, ROLES.map(lambda role: tracking.begin(game, state, role)), drives


def _begin(
    game: Game, observation: str, players: dict[Role, AbstractPolicy], bits: UInt32[Array, ""]
) -> tuple[Float[Array, " numbers"], list[Array]]:
    """Return a game's numbers, and the leaves of what it carries: taking a tree apart costs as much as a step."""
    state, nothing = game.reset(jax.random.key(bits)), jnp.zeros(())
    carried, rewards = _first(game, players, state), state.robots.map(lambda side: (nothing,) * len(side))
    known = _looked(game, carried[1], state, ~bits)
    return _packed(game, observation, state, known, rewards, [nothing] * 3), jax.tree.leaves(carried)


def _looked(
    game: Game, tracks: BySide[Track | None], state: GameState, bits: UInt32[Array, ""]
) -> BySide[tuple[Track | None, GameState]]:
    """Return what each side knows after a look at a state, and the state as it knows it."""
    return ROLES.map(lambda role: tracking.update(game, role, tracks[role], state, mixed(bits, jnp.uint32(role))))


def _step(
    game: Game, observation: str, players: dict[Role, AbstractPolicy], shape: tuple[int, ...],
    numbers: Float[Array, " numbers"], given: Int[Array, " given"] | Float[Array, " given"],
    bits: UInt32[Array, ""], carried: list[Array],
) -> tuple[Float[Array, " numbers"], list[Array]]:  # fmt: skip
    counts = game.bodies.map(len)
    rows = numbers[: _COLUMNS * sum(counts)].reshape(-1, _COLUMNS)
    asked = list(given[1:].reshape(sum(counts), *shape))
    state = as_state(rows[:, :_STATUS].ravel(), given[0].astype(jnp.int32), counts.pursuer)
    if state.status is not None:
        statuses = tuple(rows[:, _STATUS].astype(jnp.int32))
        state = replace(state, status=BySide(statuses[: counts.pursuer], statuses[counts.pursuer :]))
    actions: dict[Role, list[Action]] = {Role.PURSUER: asked[: counts.pursuer], Role.EVADER: asked[counts.pursuer :]}
    memory, tracks, drives = jax.tree.unflatten(jax.tree.structure(_first(game, players, state)), carried)
    known = _looked(game, tracks, state, bits)
    for role, player in players.items():
        own_bits = bits_of_team(bits[None], counts[role])
        seen = [player.observation(look(game, known[role][1], role, number)) for number in range(counts[role])]
        acted = [player(*own) for own in zip(seen, memory[role], own_bits, strict=True)]
        actions[role] = [action for action, _ in acted]
        memory[role] = [after for _, after in acted]
    after, drives = step_driven(game, state, drives, ROLES.map(lambda role: tuple(actions[role])))
    ends = [after.terminated, after.truncated, after.outcome]
    tracks = known.map(lambda one: one[0])
    numbers = _packed(game, observation, after.state, _looked(game, tracks, after.state, ~bits), after.rewards, ends)
    return numbers, jax.tree.leaves((memory, tracks, drives))


def _packed(
    game: Game, observation: str, state: GameState, known: BySide[tuple[Track | None, GameState]],
    rewards: BySide[tuple[Array, ...]], ends: list[Array],
) -> Float[Array, " numbers"]:  # fmt: skip
    sees, statuses = find_observation(observation), state.status or state.robots.map(lambda side: (0,) * len(side))
    robots = [
        number
        for role in Role
        for parts in zip(state.robots[role], statuses[role], rewards[role], strict=True)
        for number in jax.tree.leaves(parts)
    ]
    seen = [sees(look(game, known[role][1], role, number)) for role in Role for number, _ in enumerate(rewards[role])]
    return jnp.concatenate([jnp.stack([jnp.asarray(one).astype(jnp.float32) for one in [*robots, *ends]]), *seen])
