"""A match: what is asked for, many games on paired starts, and what the counts say."""

from dataclasses import dataclass
from functools import cached_property

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PRNGKeyArray, UInt32

from apollonius.agents.kind import Named
from apollonius.agents.pool import Pool, solo
from apollonius.arenas.charting import charted
from apollonius.arenas.file import find_game
from apollonius.catalogue import find_player
from apollonius.evaluate.result import MatchResult, count_by_arena, count_robots
from apollonius.evaluate.start_filter import StartFilter, starting
from apollonius.evaluate.statistics import wilson_interval
from apollonius.game.by_side import BySide
from apollonius.game.dynamics import action_levels
from apollonius.game.game import Game
from apollonius.game.outcome import PURSUER_WINS, counts_by_name, evader_winning
from apollonius.game.types import ROLES, GameState, Outcome
from apollonius.io.errors import require
from apollonius.io.limits import GAMES, SEED
from apollonius.play.playout import AbstractWatcher, Report, Results, play_out
from apollonius.play.replay import Replay, Trajectory, as_rows, trace
from apollonius.play.rollout import Transition


class Course(eqx.Module):
    """A game so far: both sides' latest levels, the sums of their changes, and the number of steps.

    Rows are the pursuer and the evader, columns u1 and u2, as shares of their largest values.
    """

    levels: Float[Array, "2 2"]
    changes: Float[Array, "2 2"]
    steps: Int[Array, ""]


class Changes(AbstractWatcher):
    """Adds up |change of u|."""

    def begin(self) -> Course:
        return Course(jnp.zeros((2, 2)), jnp.zeros((2, 2)), jnp.zeros((), jnp.int32))

    def follow(self, known: Course, transition: Transition) -> Course:
        now = jnp.stack([jnp.stack(action_levels(side.action)) for side in transition.sides])
        change = jnp.where(known.steps > 0, jnp.abs(now - known.levels), 0.0)
        return Course(now, known.changes + change, known.steps + 1)


def mean_change(results: Results) -> Float[np.ndarray, "2 2"]:
    """Return the mean |change of u| per step of games that `Changes` watched; rows and columns as in `Course`.

    A control that goes from one end to the other changes by 2. Games of a single step have none to change.
    """
    course: Course = results.watched
    changed = np.maximum(np.asarray(course.steps) - 1, 0).sum()
    return np.asarray(course.changes, np.float64).sum(axis=0) / max(1, changed)


@dataclass(frozen=True)
class Match:
    """A match that is asked for.

    Its starts depend on the game, the number of games, the seed and the filter alone, so matches of other players with
    the same ones are paired: they meet the very same starts.

    Attributes:
        game: by whose rules.
        players: who plays either side.
        games: how many.
        seed: of the starts and of everything random in the games.
        starts: which of the game's starts are played.

    Raises:
        InvalidInput: unless `games` is at least 1 and `seed` is not negative.
    """

    game: Game
    players: BySide[Named]
    games: int
    seed: int = 0
    starts: StartFilter = StartFilter.ALL

    def __post_init__(self) -> None:
        GAMES.require("games", self.games)
        SEED.require("seed", self.seed)

    @classmethod
    def of_names(
        cls, game: Game | str, pursuer: str, evader: str, games: int, seed: int = 0, starts: str | None = None
    ) -> "Match":
        """Return the match of a game and two players that are named, or whose files are.

        Args:
            game: the rules, or what they are called.
            starts: as of `starting`.

        Raises:
            InvalidInput: as `find_game` and `find_player`, and as a match.
        """
        rules, which = starting(find_game(game) if isinstance(game, str) else game, starts)
        names = BySide(pursuer, evader)
        players = ROLES.map(lambda role: find_player(names[role], role, rules))
        return cls(rules, players, games, seed, which)

    @cached_property
    def rules(self) -> Game:
        """The game as it is played: with charts, where players read them."""
        return charted(self.game) if any(player.policy.charted for player in self.players) else self.game

    @property
    def starts_played(self) -> str:
        """The word for its starts, as of `starting`."""
        return self.starts.word(self.game)

    @property
    def pools(self) -> BySide[Pool]:
        return self.players.map(lambda player: solo(player.policy))


@jax.jit
def _keys(seed: UInt32[Array, ""]) -> tuple[PRNGKeyArray, PRNGKeyArray]:
    start_key, play_key = jax.random.split(jax.random.key(seed))
    return start_key, play_key


def play_match(match: Match, slots: int | None = None, report: Report = lambda done, total: None) -> MatchResult:
    """Play the games of a match and count.

    Args:
        slots: games under way at a time, as in `play_out`; they change nothing but the time it takes.
        report: called several times in a second with the numbers of games ended, and of games.

    Raises:
        InvalidInput: when hardly any start of the game is viable, and those are asked for.
    """
    return count(match, play_games(match, slots, report))


def play_games(match: Match, slots: int | None = None, report: Report = lambda done, total: None) -> Results:
    """Play the games of a match; arguments and errors as those of `play_match`."""
    watcher = None if match.game.teams else Changes()
    return play_out(match.rules, match.pools, *begin(match), slots=slots, watcher=watcher, report=report)


def replay_game(match: Match, index: int) -> Trajectory:
    """Replay one game of a match, step by step.

    Args:
        index: which of the games, from 0.

    Raises:
        InvalidInput: when there is no such game, and as `play_match`.
    """
    require(0 <= index < match.games, "index", index, f"at least 0 and less than games = {match.games}")
    return trace(match.rules, match.pools, *begin(match), index)


def worst_first(results: Results) -> list[int]:
    """Return the games' numbers: those that the pursuer lost, then those without a winner, then those it won."""
    won, lost = (np.isin(results.outcome, kinds) for kinds in (PURSUER_WINS, evader_winning(time_limit_wins=False)))
    return np.argsort(won.astype(int) - lost.astype(int), kind="stable").tolist()


def record_game(match: Match, index: int) -> Replay:
    """Return one game of a match as a replay; arguments and errors as those of `replay_game`."""
    course = replay_game(match, index)
    return Replay(
        match.game, match.players.pursuer.name, match.players.evader.name, match.seed, match.games, index,
        as_rows(course.states), np.asarray(course.actions), Outcome(int(course.outcome)),
    )  # fmt: skip


def begin(match: Match) -> tuple[GameState, PRNGKeyArray]:
    """Return the starts of a match, and the key of everything random in its games."""
    start_key, play_key = _keys(np.uint32(match.seed))
    return match.starts.sample(match.game, start_key, match.games), play_key


def count(match: Match, results: Results) -> MatchResult:
    """Return the result of the games of a match, played to their ends."""
    outcome, steps = np.asarray(results.outcome), np.asarray(results.steps)
    games = len(outcome)
    counts = np.bincount(outcome, minlength=len(Outcome))
    pursuer_won = int(counts[list(PURSUER_WINS)].sum())
    evader_won = int(counts[list(evader_winning(match.game.reward.time_limit_wins))].sum())
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
        doomed_start_rate=match.starts.doomed_rate(match.game),
        capture_steps_deviation=float(np.std(steps[captured])) if captured.any() else None,
        pursuer_change=pursuer_change and tuple(pursuer_change),
        evader_change=evader_change and tuple(evader_change),
        arenas=count_by_arena(match.game.scenario, results) if match.game.scenario else None,
        robots=count_robots(results.status) if results.status else None,
    )
