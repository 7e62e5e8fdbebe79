"""One game under way behind one compiled call: what the interfaces to a single game share."""

import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, UInt8, UInt32
from PIL import Image

from apollonius.agents.policy import AbstractPolicy, Memory
from apollonius.arenas.charting import charted
from apollonius.envs.compiled import Compiled, require_unforked
from apollonius.envs.spaces import action_space, as_actions
from apollonius.game.by_side import BySide
from apollonius.game.game import Game
from apollonius.game.types import Action, GameState, Outcome, RobotStatus, Role, Timestep
from apollonius.io.errors import require
from apollonius.observe.registry import find_observation
from apollonius.observe.view import look
from apollonius.play.replay import as_state
from apollonius.play.rollout import bits_of_team
from apollonius.show.canvas import Canvas

_TERMINATED, _TRUNCATED, _OUTCOME = -3, -2, -1
"""The last numbers of what a step tells, after those of each robot: x, y, v, heading; in teams its status; its reward;
what it sees."""
_OUTCOMES = [outcome.name.lower() for outcome in Outcome]
_STATUSES = [status.name.lower() for status in RobotStatus]
_NO_BITS = np.uint32(0)


class LiveGame:
    """One game, one step at a time, either side's actions from outside or from a player of the package.

    It pickles, before its first reset as well as under way. All that a step needs and tells is one array each: passing
    a game's many numbers costs several times the step.

    Args:
        game: the rules.
        observation: name of what all robots see (`apollonius.observe.registry`).
        inside: the player of each side that is not played from outside.
        actions: kind of the actions from outside, `discrete` or `continuous`.
    """

    def __init__(
        self,
        game: Game,
        observation: str,
        inside: dict[Role, AbstractPolicy] | None = None,
        actions: str = "discrete",
    ) -> None:
        self._space = action_space(actions)
        self.idle = np.zeros(self._space.shape or (), self._space.dtype)
        """Return a placeholder for the action of a side that is played from inside."""
        reads = find_observation(observation)
        game.require_one_arena("an environment of a single game")
        inside = inside or {}
        self.game = game = charted(game) if reads.charted or any(one.charted for one in inside.values()) else game
        self.places = [(role, number) for role in Role for number in range(len(game.bodies[role]))]
        """Side and number of each robot, in the order of a game's robots."""
        count, statuses = len(self.places), len(self.places) if game.teams else 0
        self._rewards = slice(4 * count + statuses, 5 * count + statuses)
        self._statuses = slice(4 * count, 4 * count + statuses)
        ends = [self._rewards.stop + index * reads.size for index in range(count + 1)]
        self._seen = [slice(*both) for both in pairwise(ends)]
        # The game is a constant of both functions.
        self._begin = Compiled(_begin, game, observation)
        self._step = Compiled(_step, game, observation, inside, self.idle.shape)
        self._row: Array | None = None
        self._first = {role: [player.memory] * len(game.bodies[role]) for role, player in inside.items()}
        self._memory = self._first
        self._read = np.zeros(0, np.float32)
        self._steps = 0

    @property
    def begun(self) -> bool:
        return self._row is not None

    def reset(self, bits: np.uint32) -> None:
        """Begin a new game; random bits decide where."""
        require_unforked()
        self._memory = self._first
        self._take(self._begin(bits), 0)

    def step(self, actions: Sequence[Any], bits: np.uint32 = _NO_BITS) -> None:
        """Let all robots hold their actions for one step; those of a side played from inside are ignored.

        Args:
            actions: of each pursuer and each evader, all of the kind of this game's actions.
            bits: random bits for a player inside.

        Raises:
            InvalidInput: for an impossible action.
        """
        checked = [as_actions(action, self._space) for action in actions]
        given = np.empty(1 + self.idle.size * len(checked), checked[0].dtype)
        given[0], given[1:] = self._steps, np.ravel(checked)
        row, self._memory = self._step(self._row, given, bits, self._memory)
        self._take(row, self._steps + 1)

    def _take(self, row: Array, steps: int) -> None:
        self._row, self._read, self._steps = row, np.asarray(row), steps

    def observation(self, robot: int) -> Float[np.ndarray, " size"]:
        """Return the observation of a robot by its number among the game's robots."""
        return self._read[self._seen[robot]].copy()

    @property
    def rewards(self) -> list[float]:
        """Of each robot, for the last step."""
        return self._read[self._rewards].tolist()

    @property
    def statuses(self) -> list[str]:
        """Return the names of all robots' `RobotStatus`; none in a game of two."""
        return [_STATUSES[int(status)] for status in self._read[self._statuses]]

    @property
    def active(self) -> list[bool]:
        statuses = self._read[self._statuses]
        return [status == RobotStatus.ACTIVE for status in statuses.tolist()] or [True] * len(self.places)

    @property
    def terminated(self) -> bool:
        return bool(self._read[_TERMINATED])

    @property
    def truncated(self) -> bool:
        return bool(self._read[_TRUNCATED])

    @property
    def outcome(self) -> str:
        """Return `ongoing` or the name of a row of Tables II and III."""
        return _OUTCOMES[int(self._read[_OUTCOME])]

    @property
    def robots(self) -> list[float]:
        """x [m], y [m], v [m/s], heading [rad] of each pursuer, then of each evader."""
        return self._read[: 4 * len(self.places)].tolist()


def _begin(game: Game, observation: str, bits: UInt32[Array, ""]) -> Float[Array, " row"]:
    state = game.reset(jax.random.key(bits))
    nothing = jnp.zeros(())
    return _packed(game, observation, state, state.robots.map(lambda side: (nothing,) * len(side)), [nothing] * 3)


def _step(
    game: Game, observation: str, players: dict[Role, AbstractPolicy], shape: tuple[int, ...],
    row: Float[Array, " row"], given: Int[Array, " numbers"] | Float[Array, " numbers"], bits: UInt32[Array, ""],
    memory: dict[Role, list[Memory]],
) -> tuple[Float[Array, " row"], dict[Role, list[Memory]]]:  # fmt: skip
    counts = game.bodies.map(len)
    state, robots = as_state(row[: 4 * sum(counts)], given[0].astype(jnp.int32), counts.pursuer), sum(counts)
    if state.status is not None:
        statuses = tuple(row[4 * robots : 5 * robots].astype(jnp.int32))
        state = replace(state, status=BySide(statuses[: counts.pursuer], statuses[counts.pursuer :]))
    asked = list(given[1:].reshape(robots, *shape))
    actions: dict[Role, list[Action]] = {Role.PURSUER: asked[: counts.pursuer], Role.EVADER: asked[counts.pursuer :]}
    for role, player in players.items():
        own_bits = bits_of_team(bits[None], counts[role])
        seen = [player.observation(look(game, state, role, number)) for number in range(counts[role])]
        acted = [player(*own) for own in zip(seen, memory[role], own_bits, strict=True)]
        actions[role] = [action for action, _ in acted]
        memory = {**memory, role: [after for _, after in acted]}
    after: Timestep = game.step(state, actions[Role.PURSUER], actions[Role.EVADER])
    ends = [after.terminated, after.truncated, after.outcome]
    return _packed(game, observation, after.state, after.rewards, ends), memory


def _packed(
    game: Game, observation: str, state: GameState, rewards: BySide[tuple[Array, ...]], rest: list[Array]
) -> Float[Array, " row"]:
    sees = find_observation(observation)
    seen = [sees(look(game, state, role, number)) for role in Role for number in range(len(state.robots[role]))]
    status = [] if state.status is None else [one for side in state.status for one in side]
    numbers = [*jax.tree.leaves(state.robots), *status, *(one for side in rewards for one in side)]
    parts = [jnp.stack([number.astype(jnp.float32) for number in some]) for some in (numbers, rest)]
    return jnp.concatenate([parts[0], *seen, parts[1]])


RENDER_MODES = ["human", "rgb_array"]
"""`human`: every step is drawn in the terminal, in real time; `rgb_array`: `render` returns a picture."""
_COLUMNS = 72
"""Width of a drawing in the terminal [letters]."""
_UPPER_HALF = "\u2580"


class View:
    """The game of an interface, shown in one of the render modes, or not at all.

    Raises:
        InvalidInput: for an unknown render mode.
    """

    def __init__(self, live: LiveGame, mode: str | None) -> None:
        require(mode in (None, *RENDER_MODES), "render_mode", mode, f"one of {', '.join(RENDER_MODES)}, or None")
        self.mode = mode
        self._live = live
        self._canvas = Canvas(live.game) if mode else None
        self._due = 0.0

    def begin(self) -> None:
        if self._canvas:
            self._canvas = Canvas(self._live.game)
            self.follow()

    def follow(self) -> None:
        if self._canvas:
            self._canvas.move(self._live.robots, self._live.active)
            if self.mode == "human":
                self._print(self._canvas)

    def render(self) -> UInt8[np.ndarray, "height width 3"] | None:
        """The picture, in mode `rgb_array`; otherwise None, as `human` is drawn anyway and no mode means no picture."""
        return np.array(self._canvas.picture()) if self._canvas and self.mode == "rgb_array" else None

    def _print(self, canvas: Canvas) -> None:
        """Draw over the last drawing, when its time has come; in a pipe or a log, at once and one below another."""
        terminal = sys.stdout.isatty()
        if terminal:
            time.sleep(max(0.0, self._due - time.monotonic()))
            self._due = time.monotonic() + float(self._live.game.dt)
        home = "\x1b[2J\x1b[H" if terminal else ""
        print(f"{home}{in_letters(canvas.picture())}\n{self._live.outcome.replace('_', ' ')}", flush=True)


def in_letters(picture: Image.Image, columns: int = _COLUMNS) -> str:
    """A picture as lines of text, for a terminal with colours: each letter is one pixel above another."""
    rows = max(1, round(columns * picture.height / picture.width / 2))
    pixels = np.asarray(picture.resize((columns, 2 * rows), Image.Resampling.BOX)).tolist()

    def letter(upper: list[int], lower: list[int]) -> str:
        (r, g, b), (low_r, low_g, low_b) = upper, lower
        return f"\x1b[38;2;{r};{g};{b};48;2;{low_r};{low_g};{low_b}m{_UPPER_HALF}"

    lines = [map(letter, pixels[2 * row], pixels[2 * row + 1]) for row in range(rows)]
    return "\n".join("".join(line) + "\x1b[0m" for line in lines)
