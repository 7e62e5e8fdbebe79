"""The card of an agent: its score in the benchmark, and everything needed to play its games again.

The outcomes of all games are in it, and a digest of every action and reward in them, so that a round that is played
again comes out bit for bit or is refused.
"""

import secrets
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path
from typing import Literal

from apollonius.agents.kind import Named
from apollonius.arenas.file import from_dict
from apollonius.evaluate.benchmark import ROUNDS, Benchmark, Round, Score, digest_of
from apollonius.game.types import Role
from apollonius.io.cache import environment
from apollonius.io.document import parse_json, read_bytes
from apollonius.io.errors import require, require_positive, require_printable
from apollonius.io.workers import Job, Run
from apollonius.play.playout import Report, silent

FORMAT = 1
"""Version of the file format."""


@dataclass(frozen=True)
class SuiteCard:
    """An agent, its score, and everything needed to play its games again.

    Its owner's word alone are `decision_us`, `made_with` and what the `failure` of a round says.
    """

    agent: str
    sha256: str
    side: Literal["pursuer", "evader"]
    track: Literal["full", "lidar", "team"]
    score: Score
    decision_us: float
    made_with: str
    digests: dict[str, str]
    opponents: dict[str, tuple[Round, ...]]
    format: int

    def __post_init__(self) -> None:
        require_printable("agent", self.agent)
        require_printable("made_with", self.made_with)
        require_positive(self, "decision_us")
        require(self.format == FORMAT, "format", self.format, f"{FORMAT}, as this version reads")

    @property
    def benchmark(self) -> Benchmark:
        """The track, for agents of its side."""
        return Benchmark(self.track, Role[self.side.upper()])


def judge(benchmark: Benchmark, name: str, report: Report = silent, run: Run | None = None) -> SuiteCard:
    """Play all rounds of an agent, by its name or its file, here or as jobs, and return its card; errors as of
    `Benchmark.find`, and where jobs failed.
    """
    agent, side = benchmark.find(name), "pursuer" if benchmark.role == Role.PURSUER else "evader"
    rounds: dict[str, tuple[Round, ...]] = dict.fromkeys(benchmark.panel, ())
    for opponent, played in _play(benchmark, agent, product(benchmark.panel, range(ROUNDS)), report, run):
        rounds[opponent] += (played,)
    return SuiteCard(
        agent.name, digest_of(name, agent)[1], side, benchmark.track, benchmark.score(rounds),
        benchmark.microseconds(agent), environment(), benchmark.digests, rounds, FORMAT,
    )  # fmt: skip


def _play(
    benchmark: Benchmark, agent: Named, pairs: Iterable[tuple[str, int]], report: Report, run: Run | None = None
) -> Iterator[tuple[str, Round]]:
    """Yield each opponent with the round of each seed that it is paired with."""
    rounds = list(pairs)
    alone = replace(benchmark)  # without the games and players that it has found
    jobs = [Job(f"seed {pair[1]} against {pair[0]}", Benchmark.play, (alone, agent, *pair)) for pair in rounds]
    played = run(jobs) if run else (benchmark.play(agent, *pair) for pair in rounds)
    for number, ((opponent, _), one) in enumerate(zip(rounds, played, strict=True), start=1):
        yield opponent, one
        report(number, len(rounds))


def load_card(path: Path) -> SuiteCard:
    """Return the card of a file; raises InvalidInput for another file, and for a card of other arenas, rules or
    opponents than this version's, with games that cannot be, or whose score does not follow from its games.
    """
    about = f"'{path}' is no card of the benchmark; judge the agent again"
    card = from_dict(SuiteCard, parse_json(read_bytes(path, "a card", "check the path"), about), f"'{path}'")
    benchmark, games = card.benchmark, len(card.benchmark.arenas)
    names, panel = ", ".join(card.opponents), benchmark.panel
    require(tuple(card.opponents) == panel, f"'{path}': opponents", names, f"the panel: {', '.join(panel)}")
    for name, rounds in card.opponents.items():
        sizes = [(one.seed, len(one.outcomes), len(one.steps), len(one.crashed)) for one in rounds]
        whole = [(seed, games, games, games) for seed in range(ROUNDS)]
        require(sizes == whole, f"'{path}': rounds against '{name}'", "some", f"{ROUNDS} of {games} games")
    digests = benchmark.digests
    for what in digests | card.digests:
        bound = "that of this version; judge the agent again"
        digest = card.digests.get(what)
        require(digest == digests.get(what), f"'{path}': digest of the {what}", digest, bound)
    longest, robots = int(benchmark.game.max_steps), len(benchmark.game.bodies[benchmark.role])
    for name, one in [(name, one) for name, rounds in card.opponents.items() for one in rounds]:
        about = f"'{path}': seed {one.seed} against '{name}'"
        require(max(one.steps) <= longest, f"{about}: steps", max(one.steps), f"{longest} at most")
        require(max(one.crashed) <= robots, f"{about}: crashed", max(one.crashed), f"{robots} at most")
    score = benchmark.score(card.opponents)
    require(card.score == score, f"'{path}': score", asdict(card.score), f"{asdict(score)}, as its games say")
    return card


def verify(path: Path, file: str | None, every: bool, report: Report = silent) -> SuiteCard:
    """Play rounds of a card again, every one or one against each opponent, of a seed that is drawn for it; raises
    InvalidInput as `load_card`, for another agent than the card's, and where a game does not come out.
    """
    card = load_card(path)
    benchmark, name = card.benchmark, file or card.agent
    agent = benchmark.find(name)
    require(
        digest_of(name, agent)[1] == card.sha256, f"'{path}': SHA-256 of the agent", card.sha256, f"that of '{name}'"
    )
    drawn = ((opponent, secrets.randbelow(ROUNDS)) for opponent in benchmark.panel)
    pairs = product(benchmark.panel, range(ROUNDS)) if every else drawn
    for opponent, again in _play(benchmark, agent, pairs, report):
        said = card.opponents[opponent][again.seed]
        made = "" if card.made_with == environment() else f"; the card was made with {card.made_with}"
        bound = f"as it comes out, played again{made}"
        require(said == again, f"'{path}': seed {again.seed} against '{opponent}'", "as the card says", bound)
    return card
