"""A match: two players, many games on paired starts, and the counts of their outcomes."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PRNGKeyArray, UInt32

from apollonius.agents.pool import Pool, single_player
from apollonius.agents.source import NamedPlayer
from apollonius.agents.wrappers.shield import Shielded
from apollonius.arenas.charting import with_chart
from apollonius.arenas.file import find_game
from apollonius.catalogue import find_player
from apollonius.evaluate.result import (
    MatchResult,
    count_by_arena,
    count_by_detour,
    count_robots,
    count_sightings,
)
from apollonius.game.game import Game, sample_starts
from apollonius.game.outcome import PURSUER_WINS, counts_by_name, evader_winning
from apollonius.game.teams import separation
from apollonius.game.types import ROLES, BySide, Flag, GameState, Outcome, Role, Scalar
from apollonius.io.errors import require
from apollonius.io.limits import GAMES, SEED
from apollonius.io.workers import Job, JobRunner
from apollonius.observe.knowledge import Knowledge
from apollonius.observe.view import view_of
from apollonius.play.playout import Report, Results, no_report, play_out
from apollonius.play.replay import Replay, as_rows, trace
from apollonius.play.rollout import drives_at_start


def with_start_speeds(game: Game, speed: str | None) -> Game:
    """Return a game with the initial speeds `rest` or `moving`, or its own for None; raises
    InvalidInput for others.
    """
    return game if speed is None else replace(game, starts=replace(game.starts, speed=speed))


@dataclass(frozen=True)
class Match:
    """A match to be played: two players, a game, a number of games and a seed.

    Its starts depend on the game, the number of games, the seed and that alone, so matches of other
    players with the same ones are paired: they meet the very same starts.
    """

    game: Game
    players: BySide[NamedPlayer]
    games: int
    seed: int = 0

    def __post_init__(self) -> None:
        GAMES.require("games", self.games)
        SEED.require("seed", self.seed)

    @classmethod
    def of_names(
        cls,
        game: Game | str,
        pursuer: str,
        evader: str,
        games: int,
        seed: int = 0,
        starts: str | None = None,
    ) -> "Match":
        """Make the match of two players in a game.

        Args:
            game: The game, or its name or file.
            pursuer: Name or file of the pursuer.
            evader: Name or file of the evader.
            games: Number of games, at least 1.
            seed: Seed of the starts and of everything random, at least 0.
            starts: Initial speeds, `rest` or `moving`; the game's own for None.

        Raises:
            InvalidInput: As `find_game`, `find_player` and `with_start_speeds`, and for other
                numbers.
        """
        rules = with_start_speeds(find_game(game) if isinstance(game, str) else game, starts)
        names = BySide(pursuer, evader)
        players = ROLES.map(lambda role: find_player(names[role], role, rules))
        return cls(rules, players, games, seed)

    @cached_property
    def rules(self) -> Game:
        """The game as it is played: packed, and with charts where players read them."""
        needs_chart = any(player.policy.needs_chart for player in self.players)
        return with_chart(self.game, needs_chart).packed()

    @property
    def pools(self) -> BySide[Pool]:
        return self.players.map(lambda player: single_player(player.policy))


@jax.jit
def match_keys(seed: UInt32[Array, ""]) -> tuple[PRNGKeyArray, PRNGKeyArray]:
    start_key, play_key = jax.random.split(jax.random.key(seed))
    return start_key, play_key


def play_match(match: Match, report: Report = no_report) -> MatchResult:
    """Play the games of a match and count."""
    return count_results(match, play_games(match, report=report))


def play_matches(
    matches: Sequence[Match],
    on_match: Callable[[Match, MatchResult], None] = lambda match, result: None,
    report: Report = no_report,
    play: Callable[..., MatchResult] = play_match,
    run: JobRunner | None = None,
) -> list[MatchResult]:
    """Play matches one after the other, or each as a job.

    Args:
        matches: The matches.
        on_match: Called with each match and its result, unless they are jobs.
        report: Called with the games so far and in all, over all matches.
        play: Function that plays one match.
        run: Runs the matches as jobs.

    Raises:
        InvalidInput: As `run_jobs`.
    """
    if run:
        names = [" against ".join(player.name for player in match.players) for match in matches]
        return run([Job(name, play, (match,)) for name, match in zip(names, matches, strict=True)])
    results = list[MatchResult]()
    total = sum(match.games for match in matches)
    for match in matches:
        before = sum(result.games for result in results)
        results.append(
            play(match, report=lambda games, _, before=before: report(before + games, total))
        )
        on_match(match, results[-1])
    return results


def play_games(match: Match, slots: int | None = None, report: Report = no_report) -> Results:
    """Play the games of a match, in slots as `play_out`."""
    return play_out(match.rules, match.pools, *draw_starts(match), slots=slots, report=report)


def worst_first(results: Results) -> list[int]:
    """Order the games: the evader's wins, then games without a winner, then the pursuer's wins."""
    pursuer_wins = np.isin(results.outcome, PURSUER_WINS)
    evader_wins = np.isin(results.outcome, evader_winning(time_limit_wins=False))
    return np.argsort(pursuer_wins.astype(int) - evader_wins.astype(int), kind="stable").tolist()


def record_game(match: Match, index: int) -> Replay:
    """Record one game of a match, numbered from 0; raises InvalidInput for other numbers."""
    require(
        0 <= index < match.games, "index", index, f"at least 0 and less than games = {match.games}"
    )
    course = trace(match.rules, match.pools, *draw_starts(match), index)
    return Replay(
        match.game,
        match.players.pursuer.name,
        match.players.evader.name,
        match.seed,
        match.games,
        index,
        as_rows(course.states),
        np.asarray(course.actions),
        Outcome(int(course.outcome)),
        movers=jax.tree.map(lambda leaf: leaf[0], course.states.movers),
    )


def draw_starts(match: Match) -> tuple[GameState, PRNGKeyArray]:
    """Return the starts of a match, and the key of everything random in its games."""
    start_key, play_key = match_keys(np.uint32(match.seed))
    return sample_starts(match.rules, start_key, match.games), play_key


def count_results(match: Match, results: Results) -> MatchResult:
    """Count the games of a match that were played to their ends."""
    outcome = np.asarray(results.outcome)
    steps = np.asarray(results.steps)
    captured = outcome == Outcome.CAPTURED
    detours = _detours(match)
    return MatchResult(
        outcomes=counts_by_name(np.bincount(outcome, minlength=len(Outcome))),
        mean_steps=float(np.mean(steps)),
        mean_capture_steps=float(np.mean(steps[captured])) if captured.any() else None,
        time_limit_wins=match.game.reward.time_limit_wins,
        arenas=count_by_arena(match.game.scenario, results) if match.game.scenario else None,
        detours=None if detours is None else count_by_detour(detours, results),
        sight=count_sightings(results),
        unpromised=_count_unpromised(match),
        robots=count_robots(results.status) if match.game.teams else None,
    )


def _count_unpromised(match: Match) -> dict[str, int] | None:
    """Count the starts from which a side's shield promises nothing; None without any.

    From rest, a robot that is certain of itself can always stay where it is. Nothing is promised to
    robots that do not see all that moves.
    """
    game = match.rules
    counts = dict[str, int]()
    for role in ROLES:
        player = match.players[role].policy
        if not isinstance(player, Shielded):
            continue
        sensors = game.sensors and game.sensors[role]
        if game.movers and sensors and not sensors.sees_all:
            counts[role.name.lower()] = match.games
        elif game.starts.speed == "moving" or player.backup.is_uncertain:
            promises = _promises(game, player, draw_starts(match)[0], role)
            counts[role.name.lower()] = int(np.sum(~np.asarray(promises)))
    return {side: count for side, count in counts.items() if count} or None


@partial(jax.jit, static_argnames="role")
def _promises(game: Game, player: Shielded, starts: GameState, role: Role) -> Bool[Array, " games"]:
    def of_side(start: GameState) -> Flag:
        drives = drives_at_start(game, start, role)
        knowledge = Knowledge.complete(start, drives)
        robots = range(len(start.robots[role]))
        views = [view_of(game, knowledge, role, number) for number in robots]
        return jnp.all(jnp.stack([player.promises(view) for view in views]))

    return jax.vmap(of_side)(starts)


def _detours(match: Match) -> Float[np.ndarray, " games"] | None:
    """Return the shortest path over the straight line at each start; None for teams and without
    charts.
    """
    game = match.rules
    if game.teams or game.scenario is None or game.chart is None:
        return None
    return np.asarray(_detour_ratios(game, draw_starts(match)[0]))


@jax.jit
def _detour_ratios(game: Game, starts: GameState) -> Float[Array, " games"]:
    def over_line(start: GameState) -> Scalar:
        chart = game.at(start).chart
        pursuer = start.pursuer
        evader = start.evader
        assert chart is not None, "the game has a chart"
        return chart.shortest_path_length(pursuer.x, pursuer.y, evader.x, evader.y) / separation(
            pursuer, evader
        )

    return jax.vmap(over_line)(starts)
