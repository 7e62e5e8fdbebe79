"""A match: two players, many games on paired starts, and what the counts say."""

from dataclasses import asdict, dataclass
from typing import Any

import jax
import numpy as np
from jaxtyping import Array, PRNGKeyArray, UInt32

from apollonius.agents.catalogue import Named
from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.pool import solo
from apollonius.errors import require
from apollonius.evaluate.smoothness import Changes, mean_change
from apollonius.evaluate.statistics import wilson_interval
from apollonius.game.game import Game
from apollonius.game.outcome import PURSUER_WINS, counts_by_name, evader_winning
from apollonius.game.types import GameState, Outcome
from apollonius.limits import GAMES, SEED
from apollonius.playout import Report, Results, draw_starts, play_out
from apollonius.replay import Replay, Trajectory, as_rows, trace
from apollonius.solve.viability import doomed_start_rate, solve_viability, viable_starts


@jax.jit
def _keys(seed: UInt32[Array, ""]) -> tuple[PRNGKeyArray, PRNGKeyArray]:
    start_key, play_key = jax.random.split(jax.random.key(seed))
    return start_key, play_key


@dataclass(frozen=True)
class MatchResult:
    """What a match came to. Rates are in [0, 1], with Wilson 95 % intervals."""

    games: int
    outcomes: dict[str, int]
    """Games by outcome: the rows of Tables II and III, plus `both_failed`."""
    pursuer_win_rate: float
    """Captured, or only the evader failed."""
    pursuer_win_interval: tuple[float, float]
    evader_win_rate: float
    """Only the pursuer failed, or the time limit was reached where the rules count that as the evader's win."""
    evader_win_interval: tuple[float, float]
    evader_undefeated_rate: float
    """Everything but the pursuer's wins and double failures (Fig. 6)."""
    mean_steps: float
    mean_capture_steps: float | None
    """Over the captured games; None if there are none."""
    doomed_start_rate: float
    """Share of the starts from which a robot cannot help crashing (`apollonius.solve.viability`)."""
    capture_steps_deviation: float | None = None
    """Standard deviation of the length of the captured games; None if there are none."""
    pursuer_change: tuple[float, float] | None = None
    """Mean |change of u1| and of u2 per step, as shares of their largest values; None where it was not measured."""
    evader_change: tuple[float, float] | None = None
    """The same of the evader."""

    def to_dict(self) -> dict[str, Any]:
        """The result as JSON-like data."""
        return asdict(self)


def play_match(
    game: Game,
    pursuer: AbstractPolicy,
    evader: AbstractPolicy,
    games: int,
    seed: int,
    slots: int | None = None,
    viable: bool = False,
    report: Report = lambda done, total: None,
) -> MatchResult:
    """Play a number of games and count.

    The starts depend on the game, the seed, the number of games and `viable` alone, so matches of other players with
    the same ones are paired: they meet the very same starts.

    Args:
        viable: leave out the starts from which a robot cannot help crashing.
        report: called several times in a second with the numbers of games ended, and of games.

    Raises:
        InvalidInput: unless `games` is at least 1 and `seed` is not negative.
    """
    return count(game, play_games(game, pursuer, evader, games, seed, slots, viable, report), viable)


def play_games(
    game: Game,
    pursuer: AbstractPolicy,
    evader: AbstractPolicy,
    games: int,
    seed: int,
    slots: int | None = None,
    viable: bool = False,
    report: Report = lambda done, total: None,
) -> Results:
    """The games of a match, one by one; arguments and errors as those of `play_match`."""
    starts, key = begin(game, games, seed, viable)
    return play_out(game, solo(pursuer), solo(evader), starts, key, slots=slots, watcher=Changes(), report=report)


def replay_game(
    game: Game,
    pursuer: AbstractPolicy,
    evader: AbstractPolicy,
    games: int,
    seed: int,
    index: int,
    viable: bool = False,
) -> Trajectory:
    """One game of a match, step by step; the other arguments and errors are those of `play_match`.

    Args:
        index: which of the games, from 0.
    """
    require(0 <= index < games, "index", index, f"at least 0 and less than games = {games}")
    return trace(game, solo(pursuer), solo(evader), *begin(game, games, seed, viable), index)


def worst_first(results: Results) -> list[int]:
    """Numbers of the games, those that the pursuer lost first, then those without a winner, then those it won."""
    won, lost = (np.isin(results.outcome, kinds) for kinds in (PURSUER_WINS, evader_winning(time_limit_wins=False)))
    return np.argsort(won.astype(int) - lost.astype(int), kind="stable").tolist()


def record_game(
    game: Game, pursuer: Named, evader: Named, games: int, seed: int, index: int, viable: bool = False
) -> Replay:
    """One game of a match as a replay; arguments and errors as those of `replay_game`."""
    course = replay_game(game, pursuer.policy, evader.policy, games, seed, index, viable)
    return Replay(
        game, pursuer.name, evader.name, seed, games, index,
        as_rows(course.states), np.asarray(course.actions), Outcome(int(course.outcome)),
    )  # fmt: skip


def begin(game: Game, games: int, seed: int, viable: bool) -> tuple[GameState, PRNGKeyArray]:
    """The starts of a match, and the key of everything random in its games."""
    GAMES.require("games", games)
    SEED.require("seed", seed)
    start_key, play_key = _keys(np.uint32(seed))
    if viable and not _starts_at_rest(game):
        return viable_starts(game, solve_viability(game), start_key, games), play_key
    return draw_starts(game, start_key, games), play_key


def count(game: Game, results: Results, viable: bool = False) -> MatchResult:
    """What games that were played to their ends come to; `viable` as in `play_match`."""
    outcome, steps = np.asarray(results.outcome), np.asarray(results.steps)
    games = len(outcome)
    counts = np.bincount(outcome, minlength=len(Outcome))
    pursuer_won = int(counts[list(PURSUER_WINS)].sum())
    evader_won = int(counts[list(evader_winning(game.reward.time_limit_wins))].sum())
    both_failed = int(counts[Outcome.BOTH_FAILED])
    captured = outcome == Outcome.CAPTURED
    pursuer_change, evader_change = mean_change(results).tolist() if results.watched is not None else (None, None)
    return MatchResult(
        games=games,
        outcomes=counts_by_name(counts),
        pursuer_win_rate=pursuer_won / games,
        pursuer_win_interval=wilson_interval(pursuer_won, games),
        evader_win_rate=evader_won / games,
        evader_win_interval=wilson_interval(evader_won, games),
        evader_undefeated_rate=(games - pursuer_won - both_failed) / games,
        mean_steps=float(np.mean(steps)),
        mean_capture_steps=float(np.mean(steps[captured])) if captured.any() else None,
        doomed_start_rate=0.0 if viable or _starts_at_rest(game) else doomed_start_rate(game, solve_viability(game)),
        capture_steps_deviation=float(np.std(steps[captured])) if captured.any() else None,
        pursuer_change=pursuer_change and tuple(pursuer_change),
        evader_change=evader_change and tuple(evader_change),
    )


def _starts_at_rest(game: Game) -> bool:
    """Whether both robots start where they can stay, so that no start is lost."""
    return bool(game.pursuer.v_min <= 0 and game.evader.v_min <= 0) and game.starts.speed == "rest"
