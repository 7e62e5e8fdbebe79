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

from apollonius.agents.entrant import EntrantProcess, process_of
from apollonius.agents.kind import Named
from apollonius.arenas.record import from_dict
from apollonius.evaluate.benchmark import Benchmark, Round, Score, file_of
from apollonius.evaluate.names import ROUNDS
from apollonius.game.types import Outcome, Role
from apollonius.io.cache import environment
from apollonius.io.document import parse_json, read_bytes
from apollonius.io.errors import require
from apollonius.io.workers import Job, Run
from apollonius.play.playout import Report


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


def judge(
    benchmark: Benchmark, name: str, python: str, report: Report = lambda done, total: None, run: Run | None = None
) -> SuiteCard:
    """Play all rounds of an agent, by its name or its file, here or as jobs, and return its card.

    Raises:
        InvalidInput: as `Benchmark.find`, and where jobs failed.
    """
    agent, side = benchmark.find(name, python), "pursuer" if benchmark.role == Role.PURSUER else "evader"
    rounds: dict[str, tuple[Round, ...]] = dict.fromkeys(benchmark.panel, ())
    for opponent, played in _play(benchmark, agent, range(ROUNDS), report, run):
        rounds[opponent] += (played,)
    process = process_of(agent.policy)
    return SuiteCard(
        agent.name, file_of(name)[1], side, benchmark.track, benchmark.score(rounds),
        benchmark.microseconds(agent), environment(), benchmark.digests, rounds,
        process.is_isolated if process else True, process.reason if process else "",
    )  # fmt: skip


def _play(
    benchmark: Benchmark, agent: Named, seeds: Sequence[int], report: Report, run: Run | None = None
) -> Iterator[tuple[str, Round]]:
    """Yield each opponent with a round for each seed."""
    rounds, process = list(product(benchmark.panel, seeds)), process_of(agent.policy)
    alone = replace(benchmark)  # without the games and players that it has found
    jobs = [Job(f"seed {pair[1]} against {pair[0]}", _play_apart, (alone, agent, *pair)) for pair in rounds]
    played = run(jobs) if run else (_play_apart(benchmark, agent, *pair) for pair in rounds)
    for number, ((opponent, _), (one, other)) in enumerate(zip(rounds, played, strict=True), start=1):
        if process and other and run:
            process.add(other)
        yield opponent, one
        report(number, len(rounds))


def _play_apart(benchmark: Benchmark, agent: Named, opponent: str, seed: int) -> tuple[Round, EntrantProcess | None]:
    """Return a round, and the process that asked an agent from outside, which elsewhere is another one."""
    return benchmark.play(agent, opponent, seed), process_of(agent.policy)


def load_card(path: Path) -> SuiteCard:
    """Return the card of a file.

    Raises:
        InvalidInput: for another file, and for a card of other arenas, rules or opponents than this version's, or
            whose score does not follow from its games.
    """
    about = f"'{path}' is no card of the benchmark; judge the agent again"
    card = from_dict(SuiteCard, parse_json(read_bytes(path, "a card", "check the path"), about), f"'{path}'")
    benchmark = card.benchmark
    for what, found in benchmark.digests.items():
        bound = f"{found[:12]}..., as of this version; judge the agent again"
        require(card.digests.get(what) == found, f"'{path}': digest of the {what}", card.digests.get(what), bound)
    games, seeds = len(benchmark.arenas), [*range(ROUNDS)]
    whole = list(card.opponents) == list(benchmark.panel) and all(
        [one.seed for one in rounds] == seeds
        and all(len(column) == games for one in rounds for column in (one.outcomes, one.steps, one.crashed))
        and all(outcome in [*Outcome] for one in rounds for outcome in one.outcomes)
        for rounds in card.opponents.values()
    )
    require(whole, f"'{path}': opponents", "some", f"{ROUNDS} rounds of {games} games against each of the panel")
    follows = benchmark.score(card.opponents)
    require(card.score == follows, f"'{path}': score", asdict(card.score), f"{asdict(follows)}, as its games say")
    return card


def verify(
    path: Path, file: str | None, python: str, every: bool, report: Report = lambda done, total: None
) -> SuiteCard:
    """Play rounds of a card again: one against each opponent, drawn at random, or every one.

    Raises:
        InvalidInput: as `load_card`; for another agent than the card's, and where a game does not come out.
    """
    card = load_card(path)
    benchmark, name = card.benchmark, file or card.agent
    require(file_of(name)[1] == card.sha256, f"'{path}': SHA-256 of the agent", card.sha256, f"that of '{name}'")
    seeds = range(ROUNDS) if every else [secrets.randbelow(ROUNDS)]
    for opponent, again in _play(benchmark, benchmark.find(name, python), seeds, report):
        said = card.opponents[opponent][again.seed]
        where = f"'{path}': seed {again.seed} against '{opponent}'"
        for column in ("outcomes", "steps", "crashed"):
            both = zip(benchmark.arenas, getattr(said, column), getattr(again, column), strict=True)
            for arena, given, found in both:
                require(given == found, f"{where} in {arena}: {column}", given, f"{found}, played again")
        made = "" if card.made_with == environment() else f"; the card was made with {card.made_with}"
        require(said.course == again.course, f"{where}: course", said.course, f"{again.course}, played again{made}")
    return card
