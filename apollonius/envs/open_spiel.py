"""OpenSpiel's interface: the game of two robots, and cops and robbers on the graph of an arena.

Once this module is imported, `pyspiel.load_game` knows `apollonius_duel` and `apollonius_graph`.
Player 0 pursues, player 1 evades. Both games are finite, without chance, and hide nothing; a win is
worth 1, a loss -1.
"""

import math
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, UInt32

from apollonius.arenas.file import as_game
from apollonius.arenas.free_space import free_space, tile
from apollonius.game.game import MAX_STEPS, Game
from apollonius.game.outcome import PURSUER_WINS, evader_winning
from apollonius.game.types import NUM_ACTIONS, Flag, GameState, MoverStates, Outcome, Role
from apollonius.io.errors import require, require_extra
from apollonius.io.limits import ROBOTS, SEED, CountLimit
from apollonius.observe.paper import PAPER
from apollonius.observe.view import look
from apollonius.play.replay import as_state
from apollonius.solve.cop_number import SIZES

require_extra("openspiel", __name__)

import pyspiel  # noqa: E402  # pyright: ignore[reportMissingImports]
from open_spiel.python import observation  # noqa: E402  # pyright: ignore[reportMissingImports]

_CELLS = CountLimit(0, most=SIZES[-1])
_TURNS = CountLimit(0, most=10_000)
_SIDES = "pursuer", "evader"
_ACCELERATIONS = "brake", "keep speed", "accelerate"
_DIRECTIONS = "right", "straight on", "left"


_PUBLIC: dict[str, Any] = {
    "chance_mode": pyspiel.GameType.ChanceMode.DETERMINISTIC,
    "information": pyspiel.GameType.Information.PERFECT_INFORMATION,
    "utility": pyspiel.GameType.Utility.ZERO_SUM,
    "reward_model": pyspiel.GameType.RewardModel.TERMINAL,
    "max_num_players": 2,
    "min_num_players": 2,
    "provides_information_state_string": True,
    "provides_information_state_tensor": False,
    "provides_observation_string": True,
    "provides_observation_tensor": True,
}
_DUEL_TYPE = pyspiel.GameType(
    short_name="apollonius_duel",
    long_name="Apollonius: two robots among obstacles",
    dynamics=pyspiel.GameType.Dynamics.SIMULTANEOUS,
    parameter_specification={"game": "paper", "hold": 0.5, "time_limit": 100.0, "seed": 0},
    **_PUBLIC,
)
_GRAPH_TYPE = pyspiel.GameType(
    short_name="apollonius_graph",
    long_name="Apollonius: cops and robbers on the graph of an arena",
    dynamics=pyspiel.GameType.Dynamics.SEQUENTIAL,
    parameter_specification={"game": "paper", "cells": 30, "pursuers": 2, "turns": 20},
    **_PUBLIC,
)


def _game_info(num_actions: int, most_moves: int) -> pyspiel.GameInfo:
    return pyspiel.GameInfo(
        num_distinct_actions=num_actions,
        max_chance_outcomes=0,
        num_players=2,
        min_utility=-1.0,
        max_utility=1.0,
        utility_sum=0.0,
        max_game_length=most_moves,
    )


class StateObserver:
    """An observer of games that hide nothing: the numbers of a state by name, in one row, and its
    text.
    """

    def __init__(self, game: "PublicGame") -> None:
        numbers = game.new_initial_state().numbers(0)
        ends = np.cumsum([array.size for array in numbers.values()])
        self.tensor = np.zeros(ends[-1], np.float32)
        parts = np.split(self.tensor, ends[:-1])
        self.dict = {
            name: part.reshape(array.shape)
            for (name, array), part in zip(numbers.items(), parts, strict=True)
        }

    def set_from(self, state: Any, player: int) -> None:
        """Set the numbers to those of a state, for a player."""
        for name, array in state.numbers(player).items():
            self.dict[name][:] = array

    def string_from(self, state: Any, player: int) -> str:
        return str(state)


class PublicGame(pyspiel.Game):  # pyright: ignore[reportUntypedBaseClass]
    """A game that hides nothing."""

    def make_py_observer(
        self, iig_obs_type: Any = None, params: dict[str, Any] | None = None
    ) -> Any:
        """Return an observer of states, or of the history where a player is to recall all."""
        require(not params, "params", params, "left out, as observers have none")
        kind = iig_obs_type
        if kind is None or (kind.public_info and not kind.perfect_recall):
            return StateObserver(self)
        return observation.IIGObserverForPublicInfoGame(kind, params)


class DuelGame(PublicGame):
    """The game of two robots: both choose one of nine actions at the same time and hold it.

    Its parameters are `game`, a name or a file; `hold`, for how long an action is held [s];
    `time_limit` [s]; and `seed`, which draws the start. A game that nobody wins is worth 0. Raises
    InvalidInput for impossible numbers, teams, several arenas, limited sensors and slow drives.
    """

    def __init__(self, params: dict[str, Any]) -> None:
        game = as_game(params["game"])
        game.require_one_arena(__name__)
        game.require_two(__name__)
        is_plain = game.sensors is None and game.drives is None
        bound = "of robots without limited sensors and slow drives: players see all and act at once"
        require(is_plain, "game", params["game"], bound)
        SEED.require("seed", params["seed"])
        steps = _steps_of("time_limit", params["time_limit"], game)
        hold = _steps_of("hold", params["hold"], game)
        super().__init__(_DUEL_TYPE, _game_info(NUM_ACTIONS, math.ceil(steps / hold)), params)
        self.rules = jax.device_put(replace(game, max_steps=steps).packed())
        self.hold = hold
        """Steps for which an action is held."""
        self.start, self.movers_at_start = jax.device_get(
            _draw_start(self.rules, np.uint32(params["seed"]))
        )
        """x [m], y [m], v [m/s], heading [rad] of the pursuer, then of the evader; and movers."""

    def new_initial_state(self) -> "DuelState":
        return DuelState(self)


class DuelState(pyspiel.State):  # pyright: ignore[reportUntypedBaseClass]
    """The state of a `DuelGame`: both robots, the movers, the steps so far, and the outcome."""

    def __init__(self, game: DuelGame) -> None:
        super().__init__(game)
        self.robots = game.start
        self.movers = game.movers_at_start
        self.steps = 0
        self.outcome = Outcome.ONGOING

    def current_player(self) -> int:
        return pyspiel.PlayerId.TERMINAL if self.is_terminal() else pyspiel.PlayerId.SIMULTANEOUS

    def _legal_actions(self, player: int) -> list[int]:
        return list(range(NUM_ACTIONS))

    def _apply_actions(self, actions: list[int]) -> None:
        game = self.get_game()
        counts = np.int32(self.steps), np.int32(game.hold)
        before = self.robots, self.movers
        progress = _play(game.rules, before, *counts, np.array(actions, np.int32))
        (self.robots, self.movers), steps, outcome = jax.device_get(progress)
        self.steps, self.outcome = int(steps), Outcome(int(outcome))

    def _action_to_string(self, player: int, action: int) -> str:
        return f"{_SIDES[player]}: {_ACCELERATIONS[action // 3]}, {_DIRECTIONS[action % 3]}"

    def is_terminal(self) -> bool:
        return self.outcome != Outcome.ONGOING

    def returns(self) -> list[float]:
        time_limit_wins = self.get_game().rules.reward.time_limit_wins
        is_lost = self.outcome in evader_winning(time_limit_wins)
        value = float(self.outcome in PURSUER_WINS) - float(is_lost)
        return [value, -value]

    def numbers(self, player: int) -> dict[str, np.ndarray]:
        """Return the observation `paper` of a player's robot, the part of the time that is over
        and, of movers, places, velocities, clocks and goals.
        """
        rules = self.get_game().rules
        numbers = {
            "robots": np.asarray(_observe(rules, self.robots))[player],
            "time": np.array([self.steps / int(rules.max_steps)]),
        }
        return numbers if self.movers is None else numbers | {"movers": self._mover_numbers()}

    def _mover_numbers(self) -> Float[np.ndarray, " numbers"]:
        """Return all numbers of the movers but their random bits, which do not change."""
        movers = self.movers
        assert movers is not None, "the game has some"
        numbers = movers.motion, movers.clocks, movers.goal_x, movers.goal_y
        return np.concatenate(jax.tree.leaves(numbers))

    def __str__(self) -> str:
        robots = zip(_SIDES, np.split(self.robots, 2), strict=True)
        places = [f"{name} {' '.join(map(str, robot))}" for name, robot in robots]
        if self.movers is not None:
            places.append(f"movers {' '.join(map(str, self._mover_numbers()))}")
        return f"{', '.join(places)}, step {self.steps}, {self.outcome.name.lower()}"


def _steps_of(name: str, seconds: float, game: Game) -> int:
    """Return the number of a game's steps in a time; raises InvalidInput where it is not whole."""
    steps = seconds / float(game.dt)
    is_whole = 0.5 < steps <= MAX_STEPS and math.isclose(steps, round(steps), rel_tol=1e-6)
    bound = f"a whole number of steps of {float(game.dt):g} s, from 1 to {MAX_STEPS:,}"
    require(is_whole, name, f"{seconds:g} s", bound)
    return round(steps)


_Places = tuple[Float[Array, "8"], MoverStates | None]
"""Both robots in a row, and the movers."""


def _as_row(state: GameState) -> Float[Array, "8"]:
    return jnp.stack(jax.tree.leaves(state.robots))


@jax.jit
def _draw_start(game: Game, seed: UInt32[Array, ""]) -> _Places:
    start = game.reset(jax.random.key(seed))
    return _as_row(start), start.movers


@jax.jit
def _play(
    game: Game,
    places: _Places,
    steps: Int[Array, ""],
    hold: Int[Array, ""],
    actions: Int[Array, "2"],
) -> tuple[_Places, Int[Array, ""], Int[Array, ""]]:
    """Play a game while both robots hold their actions, or to its end.

    Args:
        game: The game.
        places: Both robots, as `DuelGame.start`, and the movers.
        steps: Steps so far.
        hold: Steps for which actions are held.
        actions: Actions of both.

    Returns:
        The robots and movers, the steps and the outcome thereafter.
    """

    def is_under_way(progress: tuple[GameState, Int[Array, ""]]) -> Flag:
        state, outcome = progress
        return (outcome == Outcome.ONGOING) & (state.steps < steps + hold)

    def advance(progress: tuple[GameState, Int[Array, ""]]) -> tuple[GameState, Int[Array, ""]]:
        timestep = game.step(progress[0], actions[0], actions[1])
        return timestep.state, timestep.outcome

    robots, movers = places
    start = replace(as_state(robots, steps), movers=movers), jnp.int32(Outcome.ONGOING)
    state, outcome = jax.lax.while_loop(is_under_way, advance, start)
    return (_as_row(state), state.movers), state.steps, outcome


@jax.jit
def _observe(game: Game, robots: Float[Array, "8"]) -> Float[Array, "2 8"]:
    """Return the observation `paper` of both robots."""
    state = as_state(robots, jnp.int32(0))
    return jnp.stack([PAPER(look(game, state, role)) for role in Role])


class GraphGame(PublicGame):
    """Cops and robbers: pursuers and an evader on the graph of an arena, as `apollonius pursuers`
    judges it.

    First the pursuers choose their nodes, then the evader its own; from then on each moves in its
    turn to a neighbour or stays, first the pursuers one by one, then the evader. It is caught where
    a pursuer is at its node, and wins after a number of turns.

    Its parameters are `game`, a name or a file; `cells`, about the number of hexagons that the free
    space is cut into; `pursuers`; and `turns`. Raises InvalidInput for impossible numbers and for
    several arenas.

    Attributes:
        tiling: The graph.
        around: The nodes that each node leads to, its own among them.
        pursuers: The number of pursuers.
    """

    def __init__(self, params: dict[str, Any]) -> None:
        game = as_game(params["game"])
        game.require_one_arena(__name__)
        _CELLS.require("cells", params["cells"])
        ROBOTS.require("pursuers", params["pursuers"])
        _TURNS.require("turns", params["turns"])
        space = free_space(game)
        tiling = tile(space, space.spacing_of(params["cells"]), 0.0)
        nodes = len(tiling.places)
        most_moves = (params["pursuers"] + 1) * (params["turns"] + 1)
        super().__init__(_GRAPH_TYPE, _game_info(nodes, most_moves), params)
        self.tiling = tiling
        self.around = [
            np.flatnonzero(row).tolist() for row in tiling.adjacency | np.eye(nodes, dtype=bool)
        ]
        self.pursuers = params["pursuers"]

    def new_initial_state(self) -> "GraphState":
        return GraphState(self)


class GraphState(pyspiel.State):  # pyright: ignore[reportUntypedBaseClass]
    """The state of a `GraphGame`: the nodes of the robots that have one, the evader's last, and the
    moves so far.
    """

    def __init__(self, game: GraphGame) -> None:
        super().__init__(game)
        self.places: tuple[int, ...] = ()
        self.moves = 0

    @property
    def mover(self) -> int:
        """Number of the robot that is to move."""
        return self.moves % (self.get_game().pursuers + 1)

    @property
    def is_caught(self) -> bool:
        """Check whether a pursuer is at the evader's node."""
        pursuers, evader = self.places[: self.get_game().pursuers], self.places[-1:]
        return len(self.places) > len(pursuers) and evader[0] in pursuers

    def current_player(self) -> int:
        if self.is_terminal():
            return pyspiel.PlayerId.TERMINAL
        return int(self.mover == self.get_game().pursuers)

    def _legal_actions(self, player: int) -> list[int]:
        around = self.get_game().around
        is_placed = self.mover < len(self.places)
        return around[self.places[self.mover]] if is_placed else list(range(len(around)))

    def _apply_action(self, action: int) -> None:
        mover = self.mover
        self.places = (*self.places[:mover], action, *self.places[mover + 1 :])
        self.moves += 1

    def _action_to_string(self, player: int, action: int) -> str:
        return f"{_SIDES[player]} to node {action}"

    def is_terminal(self) -> bool:
        return self.is_caught or self.moves == self.get_game().max_game_length()

    def returns(self) -> list[float]:
        value = (1.0 if self.is_caught else -1.0) if self.is_terminal() else 0.0
        return [value, -value]

    def numbers(self, player: int) -> dict[str, np.ndarray]:
        """Return the robots' nodes and the robot to move, as ones among zeros, and the part of the
        time that is over.
        """
        game = self.get_game()
        places = np.zeros((game.pursuers + 1, len(game.around)))
        places[np.arange(len(self.places)), np.array(self.places, int)] = 1
        return {
            "places": places,
            "mover": np.arange(len(places)) == self.mover,
            "time": np.array([self.moves / game.max_game_length()]),
        }

    def __str__(self) -> str:
        return f"nodes {' '.join(map(str, self.places))}, move {self.moves}"


pyspiel.register_game(_DUEL_TYPE, DuelGame)
pyspiel.register_game(_GRAPH_TYPE, GraphGame)
