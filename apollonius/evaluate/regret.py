"""How far a pursuer is from optimal play against a target that stands still."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from apollonius.agents.classical import Still
from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.pool import solo
from apollonius.errors import require
from apollonius.evaluate.statistics import wilson_interval
from apollonius.game.by_side import BySide
from apollonius.game.game import Game, distance, sample_starts
from apollonius.game.types import GameState, Outcome, RobotState
from apollonius.limits import GAMES, SEED, TARGETS
from apollonius.playout import play_out
from apollonius.solve.reach import Chase, Reach, solve_reach
from apollonius.solve.table_policy import TablePolicy

_WORST = 10
"""Games that a result lists."""


@dataclass(frozen=True)
class Regret:
    """A pursuer beside the table's, on the same starts. Rates are in [0, 1], with Wilson 95 % intervals; times in s."""

    games: int
    targets: int
    captured: float
    """Share of the games that the pursuer captures in."""
    captured_interval: tuple[float, float]
    ceiling: float
    """The same for the table's player."""
    ceiling_interval: tuple[float, float]
    mean_seconds: float | None
    """To capture, over the games that both capture in; None if there are none."""
    mean_seconds_table: float | None
    """The same for the table's player."""
    median_regret: float | None
    """By how much the pursuer takes longer, in the median of those games."""
    regret_99: float | None
    """The same, exceeded in one game of a hundred."""
    prediction_error: float | None
    """Median of |time the table's player took / time the table said - 1|."""
    worst: list[dict[str, Any]]
    """The games in which most is lost, those without a capture first; a start is x, y, v, heading."""

    def to_dict(self) -> dict[str, Any]:
        """The result as JSON-like data."""
        return asdict(self)


def measure_regret(
    chase: Chase,
    pursuer: AbstractPolicy,
    games: int,
    targets: int,
    seed: int,
    report: Callable[[int], None] = lambda done: None,
) -> Regret:
    """Solve the game for some targets, and play the pursuer and the table's player from the same starts.

    Args:
        chase: the game on a grid.
        games: games in all, as many for each target.
        targets: places of the target, drawn as the game draws the evader's.
        seed: of the targets and the starts.
        report: told how many targets are done.

    Raises:
        InvalidInput: unless there is a target and `games` is a multiple of `targets`; where they leave no room.
    """
    game = chase.game
    TARGETS.require("targets", targets)
    GAMES.require("games", games)
    require(games % targets == 0, "games", games, f"a multiple of the {targets} targets")
    SEED.require("seed", seed)
    target_key, start_key, play_key = jax.random.split(jax.random.key(seed), 3)
    places = sample_starts(game, target_key, targets).evader
    parts: list[dict[str, np.ndarray]] = []
    for index, place in enumerate(zip(places.x.tolist(), places.y.tolist(), strict=True)):
        reach, _ = solve_reach(chase, place)
        starts = _starts(game, place, jax.random.fold_in(start_key, index), games // targets)
        parts.append(_play(game, pursuer, reach, starts, jax.random.fold_in(play_key, index)))
        report(index + 1)
    return _summary({name: np.concatenate([part[name] for part in parts]) for name in parts[0]}, targets)


def _starts(game: Game, target: tuple[float, float], key: PRNGKeyArray, games: int) -> GameState:
    """Starts of the game whose evader stands at the target, but for those where the pursuer would be too near.

    Raises:
        InvalidInput: when that leaves hardly any.
    """
    still = RobotState(*(jnp.asarray(number, jnp.float32) for number in (*target, 0.0, 0.0)))
    drawn = sample_starts(game, key, 4 * games + 64)
    starts = jax.vmap(lambda state: GameState.of_two(state.pursuer, still, state.steps))(drawn)
    chosen = np.flatnonzero(jax.vmap(distance)(starts) >= game.starts.separation)[:games]
    require(
        len(chosen) == games, "starts.separation", game.starts.separation,
        f"small enough that a quarter of the places are that far from ({target[0]:.2f}, {target[1]:.2f})",
    )  # fmt: skip
    return jax.tree.map(lambda leaf: leaf[chosen], starts)


def _play(
    game: Game, pursuer: AbstractPolicy, reach: Reach, starts: GameState, key: PRNGKeyArray
) -> dict[str, np.ndarray]:
    """Both players' games against one target, as columns."""
    both = {"agent": pursuer, "table": TablePolicy(reach)}
    results = {name: play_out(game, BySide(solo(policy), solo(Still())), starts, key) for name, policy in both.items()}
    columns = {f"{name}_outcome": np.asarray(result.outcome) for name, result in results.items()}
    columns |= {f"{name}_seconds": np.asarray(result.steps) * float(game.dt) for name, result in results.items()}
    columns["predicted"] = np.asarray(_predict(reach, starts.pursuer))
    columns["target"] = np.tile([float(reach.target_x), float(reach.target_y)], (len(columns["predicted"]), 1))
    robot = starts.pursuer
    columns["start"] = np.stack([np.asarray(leaf) for leaf in (robot.x, robot.y, robot.v, robot.heading)], axis=1)
    return columns


@eqx.filter_jit
def _predict(reach: Reach, robots: RobotState) -> Float[Array, " games"]:
    return jax.vmap(reach.seconds)(robots)


def _summary(columns: dict[str, np.ndarray], targets: int) -> Regret:
    caught = {name: columns[f"{name}_outcome"] == Outcome.CAPTURED for name in ("agent", "table")}
    games, both = len(caught["agent"]), caught["agent"] & caught["table"]
    late = columns["agent_seconds"] - columns["table_seconds"]
    error = np.abs(columns["table_seconds"] / columns["predicted"] - 1)[caught["table"]]
    # Games that only the table's player wins are lost whole; among the others, seconds count.
    lost = np.where(both, late, np.where(caught["table"], np.inf, -np.inf))
    return Regret(
        games=games,
        targets=targets,
        captured=float(np.mean(caught["agent"])),
        captured_interval=wilson_interval(int(np.sum(caught["agent"])), games),
        ceiling=float(np.mean(caught["table"])),
        ceiling_interval=wilson_interval(int(np.sum(caught["table"])), games),
        mean_seconds=_mean(columns["agent_seconds"][both]),
        mean_seconds_table=_mean(columns["table_seconds"][both]),
        median_regret=float(np.median(late[both])) if both.any() else None,
        regret_99=float(np.quantile(late[both], 0.99)) if both.any() else None,
        prediction_error=float(np.median(error)) if len(error) else None,
        worst=[
            {
                "start": [round(float(number), 3) for number in columns["start"][index]],
                "target": [round(float(number), 3) for number in columns["target"][index]],
                "outcome": Outcome(int(columns["agent_outcome"][index])).name.lower(),
                "seconds": round(float(columns["agent_seconds"][index]), 2),
                "seconds_table": round(float(columns["table_seconds"][index]), 2),
            }
            for index in np.argsort(-lost, kind="stable")[:_WORST]
        ],
    )


def _mean(seconds: np.ndarray) -> float | None:
    return float(np.mean(seconds)) if len(seconds) else None
