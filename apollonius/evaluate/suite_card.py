"""The card of an agent: its score in the benchmark, and everything needed to play its games again.

The outcomes of all games are in it, and a digest of every action and reward in them, so that a round that is played
again comes out bit for bit or is refused.
"""

import secrets
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path
from typing import Literal

from apollonius.agents.entrant import process_of
from apollonius.agents.kind import Named
from apollonius.arenas.file import from_dict
from apollonius.evaluate.benchmark import ROUNDS, Benchmark, Round, Score, file_of
from apollonius.game.types import Role
from apollonius.io.cache import environment
from apollonius.io.document import parse_json, read_bytes
from apollonius.io.errors import require
from apollonius.io.workers import Job, Run
from apollonius.play.playout import Report, silent


@dataclass(frozen=True)
class SuiteCard:
    """An agent, its score, and everything needed to play its games again."""

    agent: str
    sha256: str
    side: Literal["pursuer", "evader"]
    track: Literal["full", "lidar", "team"]
    score: Score
    decision_us: float
    made_with: str
    digests: dict[str, str]
    opponents: dict[str, tuple[Round, ...]]
    isolated: bool = True
    failure: str = ""
    format: Literal[1] = 1

    @property
    def benchmark(self) -> Benchmark:
        """The track, for agents of its side."""
        return Benchmark(self.track, Role[self.side.upper()])


def judge(benchmark: Benchmark, name: str, python: str, report: Report = silent, run: Run | None = None) -> SuiteCard:
    """Play all rounds of an agent, by its name or its file, here or as jobs, and return its card; errors as of
    `Benchmark.find`, and where jobs failed.
    """
    agent, side = benchmark.find(name, python), "pursuer" if benchmark.role == Role.PURSUER else "evader"
    rounds: dict[str, tuple[Round, ...]] = dict.fromkeys(benchmark.panel, ())
    for opponent, played in _play(benchmark, agent, range(ROUNDS), report, run):
        rounds[opponent] += (played,)
    process = process_of(agent.policy)
    failure, spent = process.reason if process else "", benchmark.microseconds(agent)
    return SuiteCard(
        agent.name, file_of(name)[1], side, benchmark.track, benchmark.score(rounds), spent, environment(),
        benchmark.digests, rounds, process.is_isolated if process else True, failure,
    )  # fmt: skip


def _play(
    benchmark: Benchmark, agent: Named, seeds: Sequence[int], report: Report, run: Run | None = None
) -> Iterator[tuple[str, Round]]:
    """Yield each opponent with a round for each seed."""
    rounds, process = list(product(benchmark.panel, seeds)), process_of(agent.policy)
    alone = replace(benchmark)  # without the games and players that it has found
    jobs = [Job(f"seed {pair[1]} against {pair[0]}", _play_apart, (alone, agent, *pair)) for pair in rounds]
    played = run(jobs) if run else (_play_apart(benchmark, agent, *pair) for pair in rounds)
    for number, ((opponent, _), (one, reason)) in enumerate(zip(rounds, played, strict=True), start=1):
        if process:
            process.reason = process.reason or reason
        yield opponent, one
        report(number, len(rounds))


def _play_apart(benchmark: Benchmark, agent: Named, opponent: str, seed: int) -> tuple[Round, str]:
    """Return a round, and why an agent from outside failed in it."""
    played, process = benchmark.play(agent, opponent, seed), process_of(agent.policy)
    return played, process.reason if process else ""


def load_card(path: Path) -> SuiteCard:
    """Return the card of a file; raises InvalidInput for another file, and for a card of other arenas, rules or
    opponents than this version's, or whose score does not follow from its games.
    """
    about = f"'{path}' is no card of the benchmark; judge the agent again"
    card = from_dict(SuiteCard, parse_json(read_bytes(path, "a card", "check the path"), about), f"'{path}'")
    benchmark = card.benchmark
    for what, found in benchmark.digests.items():
        bound = f"{found[:12]}..., as of this version; judge the agent again"
        require(card.digests.get(what) == found, f"'{path}': digest of the {what}", card.digests.get(what), bound)
    games, found = len(benchmark.arenas), [(name, one) for name, rounds in card.opponents.items() for one in rounds]
    sizes = [(name, one.seed, len(one.outcomes), len(one.steps), len(one.crashed)) for name, one in found]
    whole = [(name, seed, games, games, games) for name, seed in product(benchmark.panel, range(ROUNDS))]
    require(
        sizes == whole, f"'{path}': opponents", "some", f"{ROUNDS} rounds of {games} games against each of the panel"
    )
    follows = benchmark.score(card.opponents)
    require(card.score == follows, f"'{path}': score", asdict(card.score), f"{asdict(follows)}, as its games say")
    return card


def verify(path: Path, file: str | None, python: str, every: bool, report: Report = silent) -> SuiteCard:
    """Play rounds of a card again, one against each opponent or every one; raises InvalidInput as `load_card`, for
    another agent than the card's, and where a game does not come out.
    """
    card = load_card(path)
    benchmark, name = card.benchmark, file or card.agent
    require(file_of(name)[1] == card.sha256, f"'{path}': SHA-256 of the agent", card.sha256, f"that of '{name}'")
    seeds = range(ROUNDS) if every else [secrets.randbelow(ROUNDS)]
    for opponent, again in _play(benchmark, benchmark.find(name, python), seeds, report):
        said = card.opponents[opponent][again.seed]
        made = "" if card.made_with == environment() else f"; the card was made with {card.made_with}"
        bound = f"as it comes out, played again{made}"
        require(said == again, f"'{path}': seed {again.seed} against '{opponent}'", "as the card says", bound)
    return card
