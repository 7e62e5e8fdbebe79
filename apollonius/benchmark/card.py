"""The card of an agent: its score in the benchmark, and everything needed to play its games again.

The outcomes of all games are in it, and a digest of every action and reward in them, so that a
round that is played again comes out bit for bit or is refused.
"""

import secrets
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path
from typing import Literal

from apollonius.agents.source import NamedPlayer
from apollonius.arenas.file import from_dict
from apollonius.benchmark.track import ROUNDS, Benchmark, Round, Score, digest_of
from apollonius.game.types import Role
from apollonius.io.cache import environment
from apollonius.io.document import parse_json, read_bytes
from apollonius.io.errors import require, require_positive, require_printable
from apollonius.io.workers import Job, JobRunner
from apollonius.play.playout import Report, no_report

FORMAT = 1
"""Version of the file format."""


@dataclass(frozen=True)
class SuiteCard:
    """An agent, its score, and everything needed to play its games again.

    Its owner's word alone are `decision_us`, `versions` and what the `failure` of a round says.
    """

    agent: str
    sha256: str
    side: Literal["pursuer", "evader"]
    track: Literal["full", "lidar", "team"]
    score: Score
    decision_us: float
    versions: str
    digests: dict[str, str]
    opponents: dict[str, tuple[Round, ...]]
    format: int

    def __post_init__(self) -> None:
        require_printable("agent", self.agent)
        require_printable("versions", self.versions)
        require_positive(self, "decision_us")
        require(self.format == FORMAT, "format", self.format, f"{FORMAT}, as this version reads")

    @property
    def benchmark(self) -> Benchmark:
        """The track, for agents of its side."""
        return Benchmark(self.track, Role[self.side.upper()])


def judge_agent(
    benchmark: Benchmark, name: str, report: Report = no_report, run: JobRunner | None = None
) -> SuiteCard:
    """Play all rounds of an agent and return its card.

    Args:
        benchmark: The benchmark.
        name: Name or file of the agent.
        report: Called with the rounds so far and in all.
        run: Runs the rounds as jobs; None plays them in this process.

    Raises:
        InvalidInput: As `Benchmark.find`, and where jobs failed.
    """
    agent = benchmark.find(name)
    side = "pursuer" if benchmark.role == Role.PURSUER else "evader"
    rounds: dict[str, tuple[Round, ...]] = dict.fromkeys(benchmark.panel, ())
    for opponent, game_round in _play(
        benchmark, agent, product(benchmark.panel, range(ROUNDS)), report, run
    ):
        rounds[opponent] += (game_round,)
    return SuiteCard(
        agent.name,
        digest_of(name, agent)[1],
        side,
        benchmark.track,
        benchmark.score(rounds),
        benchmark.microseconds(agent),
        environment(),
        benchmark.digests,
        rounds,
        FORMAT,
    )


def _play(
    benchmark: Benchmark,
    agent: NamedPlayer,
    pairs: Iterable[tuple[str, int]],
    report: Report,
    run: JobRunner | None = None,
) -> Iterator[tuple[str, Round]]:
    """Yield each opponent and the round of each pair of an opponent and a seed."""
    rounds = list(pairs)
    bare_benchmark = replace(benchmark)  # without its cached game and players
    jobs = [
        Job(
            f"seed {seed} against {opponent}",
            Benchmark.play,
            (bare_benchmark, agent, opponent, seed),
        )
        for opponent, seed in rounds
    ]
    results = run(jobs) if run else (benchmark.play(agent, *pair) for pair in rounds)
    by_pair = zip(rounds, results, strict=True)
    for number, ((opponent, _), game_round) in enumerate(by_pair, start=1):
        yield opponent, game_round
        report(number, len(rounds))


def load_card(path: Path) -> SuiteCard:
    """Load the card of a file.

    Raises:
        InvalidInput: If the file is no card; if the card is of other arenas, rules or opponents
            than this version's; if its games are impossible; if its score does not follow from its
            games.
    """
    about = f"'{path}' is no card of the benchmark; judge the agent again"
    data = parse_json(read_bytes(path, "a card", "check the path"), about)
    card = from_dict(SuiteCard, data, f"'{path}'")
    _require_all_games(card, path)
    benchmark = card.benchmark
    digests = benchmark.digests
    for part in digests | card.digests:
        bound = "that of this version; judge the agent again"
        digest = card.digests.get(part)
        require(digest == digests.get(part), f"'{path}': digest of the {part}", digest, bound)
    _require_possible_games(card, path)
    score = benchmark.score(card.opponents)
    score_bound = f"{asdict(score)}, as its games say"
    require(card.score == score, f"'{path}': score", asdict(card.score), score_bound)
    return card


def _require_all_games(card: SuiteCard, path: Path) -> None:
    """Require a round of each seed against each opponent, with a game in each arena."""
    panel = card.benchmark.panel
    names = ", ".join(card.opponents)
    panel_bound = f"the panel: {', '.join(panel)}"
    require(tuple(card.opponents) == panel, f"'{path}': opponents", names, panel_bound)
    games = len(card.benchmark.arenas)
    for name, rounds in card.opponents.items():
        is_whole = [game_round.seed for game_round in rounds] == [*range(ROUNDS)]
        for game_round in rounds:
            for column in (game_round.outcomes, game_round.steps, game_round.crashed):
                is_whole = is_whole and len(column) == games
        bound = f"{ROUNDS} of {games} games"
        require(is_whole, f"'{path}': rounds against '{name}'", "some", bound)


def _require_possible_games(card: SuiteCard, path: Path) -> None:
    """Require games within the time limit, in which no more robots crashed than there are."""
    game = card.benchmark.game
    most_steps = int(game.max_steps)
    robots = len(game.bodies[card.benchmark.role])
    for name, rounds in card.opponents.items():
        for game_round in rounds:
            about = f"'{path}': seed {game_round.seed} against '{name}'"
            steps = max(game_round.steps)
            crashed = max(game_round.crashed)
            require(steps <= most_steps, f"{about}: steps", steps, f"{most_steps} at most")
            require(crashed <= robots, f"{about}: crashed", crashed, f"{robots} at most")


def verify(path: Path, file: str | None, every: bool, report: Report = no_report) -> SuiteCard:
    """Play rounds of a card again and compare them with the card.

    Args:
        path: File of the card.
        file: Name or file of the agent; the name on the card for None.
        every: Whether every round is played; otherwise one of a random seed against each opponent.
        report: Called with the rounds so far and in all.

    Raises:
        InvalidInput: As `load_card`; if the agent is not the card's; if a round comes out
        otherwise.
    """
    card = load_card(path)
    benchmark = card.benchmark
    name = file or card.agent
    agent = benchmark.find(name)
    sha256 = digest_of(name, agent)[1]
    require(
        sha256 == card.sha256, f"'{path}': SHA-256 of the agent", card.sha256, f"that of '{name}'"
    )
    sample = ((opponent, secrets.randbelow(ROUNDS)) for opponent in benchmark.panel)
    pairs = product(benchmark.panel, range(ROUNDS)) if every else sample
    for opponent, replayed in _play(benchmark, agent, pairs, report):
        recorded = card.opponents[opponent][replayed.seed]
        about = f"'{path}': seed {replayed.seed} against '{opponent}'"
        bound = "as it comes out, played again"
        if card.versions != environment():
            bound += f"; the card was made with {card.versions}"
        require(recorded == replayed, about, "as the card says", bound)
    return card
