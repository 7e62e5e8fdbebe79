"""The benchmark: an agent against a fixed panel in the held-out arenas of a suite, a round being a game in each."""

import os
import re
import timeit
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from hashlib import sha256
from pathlib import Path
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, UInt32

from apollonius.agents.kind import Named
from apollonius.agents.names import SEARCHING, SHIELDED
from apollonius.agents.onnx_agent import OnnxAgent, OnnxProcess, process_of
from apollonius.agents.trained import file_of
from apollonius.arenas.charting import charted
from apollonius.arenas.file import find_game, to_dict
from apollonius.arenas.suite import suite_entries
from apollonius.catalogue import find_player
from apollonius.evaluate.match import Match, begin
from apollonius.evaluate.result import worst_mean
from apollonius.evaluate.statistics import mean_interval
from apollonius.game.game import Game
from apollonius.game.outcome import EVADER_FAILS, PURSUER_FAILS, PURSUER_WINS, evader_winning
from apollonius.game.presets import in_teams, make_game
from apollonius.game.types import BySide, Outcome, RobotStatus, Role
from apollonius.io.cache import digest
from apollonius.io.errors import require, require_printable
from apollonius.io.limits import ONNX
from apollonius.observe.observation import perceive
from apollonius.play import rollout
from apollonius.play.playout import AbstractWatcher, Results, play_out
from apollonius.play.random_bits import random_bits
from apollonius.play.rollout import Transition

_EVADERS = ("still", "hide", "evader", "shielded:evader")
_PURSUERS = {
    "full": ("pure-pursuit", "intercept", "pursuer", "shielded:pursuer"),
    "lidar": ("intercept", "search", "searching:pursuer", "shielded:searching:pursuer"),
    "team": ("pure-pursuit", "intercept", "pursuer", "shielded:pursuer"),
}
PANELS = {track: {"pursuer": pursuers, "evader": _EVADERS} for track, pursuers in _PURSUERS.items()}
"""By track: the players of either side that an agent of the other one meets; other panels are another benchmark."""
SUITE, PART = "suite-v2", "held-out"
"""The arenas that are played in."""
ROUNDS = 2
"""Games in each arena against each opponent."""
FORFEIT = int(Outcome.ONGOING)
"""In the place of an outcome: an agent from outside failed, and its game counts as lost."""
_COURSE = re.compile("[0-9a-f]{16}")
_SLOTS = 32
_FAILED = BySide(PURSUER_FAILS, EVADER_FAILS)
_CALLS = 10


@dataclass(frozen=True)
class Round:
    """A game in each arena, in their order: its outcome, its length [steps], and how many own robots crashed or left.

    The seed is that of the match of as many games, `course` a digest of all that was done, `failure` why an agent
    from outside forfeited games.
    """

    seed: int
    outcomes: tuple[int, ...]
    steps: tuple[int, ...]
    crashed: tuple[int, ...]
    course: str
    failure: str = field(compare=False)

    def __post_init__(self) -> None:
        require(set(self.outcomes) <= {*Outcome}, "outcomes", self.outcomes, "0, a forfeit, or how games end, 1 to 7")
        require(min(self.steps, default=1) >= 1, "steps", min(self.steps, default=1), "1 at least")
        require(min(self.crashed, default=0) >= 0, "crashed", min(self.crashed, default=0), "0 at least")
        require(_COURSE.fullmatch(self.course), "course", self.course, "16 hexadecimal digits")
        require_printable("failure", self.failure)
        forfeits = FORFEIT in self.outcomes
        require(forfeits == bool(self.failure), "failure", self.failure, "given where games are forfeited, only there")


@dataclass(frozen=True)
class Score:
    """The numbers of a card: its worth against the opponent that it is worth least against, and shares of all games.

    The worth is wins less losses, the time limit being the evader's win: the mean over the arenas with its 95 %
    interval, and that over their worst tenth. In `crashes` a robot of its own crashed or left, in `forfeits` it failed
    to act.
    """

    worth: float
    interval: tuple[float, float]
    against: str
    worst_tenth: float
    crashes: float
    forfeits: float


class Fingerprint(AbstractWatcher):
    """A number that any other action or reward in a game changes (FNV-1a over words of 32 bits)."""

    def begin(self) -> UInt32[Array, ""]:
        return jnp.uint32(0x811C9DC5)

    def follow(self, known: UInt32[Array, ""], transition: Transition) -> UInt32[Array, ""]:
        for side in transition.sides:
            for leaf in (side.action, side.reward):
                for word in jax.lax.bitcast_convert_type(leaf, jnp.uint32).ravel():
                    known = (known ^ word) * jnp.uint32(0x01000193)
        return known


@dataclass(frozen=True)
class Benchmark:
    """A track of the benchmark, for agents of one side."""

    track: Literal["full", "lidar", "team"]
    role: Role

    @property
    def panel(self) -> tuple[str, ...]:
        """The opponents."""
        return PANELS[self.track][self.role.other.name.lower()]

    @cached_property
    def game(self) -> Game:
        """The game in all arenas, with their charts."""
        game = find_game(f"{SUITE}/{PART}")
        if self.track == "lidar":
            game = replace(game, sensors=make_game("lidar").sensors)
        return charted(in_teams(game, 2, 1) if self.track == "team" else game)

    @property
    def arenas(self) -> tuple[str, ...]:
        """The names of the arenas."""
        return tuple(entry.name for entry in suite_entries(SUITE, PART))

    @cached_property
    def digests(self) -> dict[str, str]:
        """Digests of the arenas, the rules and the opponents."""
        arenas = [entry.sha256 for entry in suite_entries(SUITE, PART)]
        return {
            "suite": digest(arenas),
            "game": digest(to_dict(self.game)),
            "panel": digest([*map(digest_of, self.panel)]),
        }

    def find(self, name: str) -> Named:
        """Return the player of a name or a file; errors as those of `find_player` and `OnnxProcess`."""
        if name.endswith(ONNX):
            return Named(Path(name).name, OnnxAgent(OnnxProcess(Path(name))))
        return find_player(name, self.role, self.game)

    def play(self, agent: Named, opponent: str, seed: int) -> Round:
        """Play a round."""
        match, process = self._round(agent, opponent, seed)
        slots = match.games if process else _SLOTS
        results = play_out(match.rules, match.pools, *begin(match), slots=slots, watcher=Fingerprint())
        outcomes, steps, crashed = np.array(results.outcome), np.array(results.steps), self._crashed(results)
        if process:
            process.end()
            outcomes[[*process.forfeited]] = FORFEIT
        words = np.stack([outcomes, steps, crashed, np.asarray(results.watched)]).astype("<u4").tobytes()
        played, lengths, crashes = (tuple(column.tolist()) for column in (outcomes, steps, crashed))
        course, failure = sha256(words).hexdigest()[:16], process.reason if process else ""
        return Round(seed, played, lengths, crashes, course, failure)

    def _round(self, agent: Named, opponent: str, seed: int) -> tuple[Match, OnnxProcess | None]:
        """Return the match of a round, and the process of an agent from outside, which is begun for it."""
        match = Match(self.game, BySide.of(self.role, agent, self._opponents[opponent]), len(self.arenas), seed)
        if process := process_of(agent.policy):
            process.begin(match.games)
        return match, process

    def microseconds(self, agent: Named) -> float:
        """Return the time of a decision [us], as one of a round's first ones, all at once."""
        match, process = self._round(agent, self.panel[0], 0)
        starts, key = begin(match)
        bits = random_bits(key, (2, match.games))
        games = rollout.begin(match.rules, starts, match.pools, bits)

        def decide() -> None:
            jax.block_until_ready(_act(match.rules, match.pools[self.role], games, bits, self.role))

        spent = timeit.repeat(decide, number=1, repeat=_CALLS + 1)  # the first one compiles
        if process:
            process.end()
        return _rounded(1e6 * float(np.median(spent[1:])) / (match.games * len(self.game.bodies[self.role])))

    @cached_property
    def _opponents(self) -> dict[str, Named]:
        return {name: find_player(name, self.role.other, self.game) for name in self.panel}

    def _crashed(self, results: Results) -> np.ndarray:
        """Return how many own robots crashed or left in each game."""
        if results.status is None:
            return np.isin(results.outcome, (Outcome.BOTH_FAILED, *_FAILED[self.role])).astype(int)
        robots = np.stack([np.asarray(status) for status in results.status[self.role]])
        return np.isin(robots, (RobotStatus.HIT_OBSTACLE, RobotStatus.OUT_OF_RANGE)).sum(axis=0)

    def score(self, opponents: Mapping[str, Sequence[Round]]) -> Score:
        """Return the score that follows from rounds against each opponent."""
        worths = {name: np.mean([self._worths(one) for one in rounds], axis=0) for name, rounds in opponents.items()}
        against = min(worths, key=lambda name: float(np.mean(worths[name])))
        least, every = worths[against], [one for rounds in opponents.values() for one in rounds]
        low, high = mean_interval(least, -1.0, 1.0)
        return Score(
            worth=_rounded(np.mean(least)),
            interval=(_rounded(low), _rounded(high)),
            against=against,
            worst_tenth=_rounded(worst_mean(least)),
            crashes=_rounded(np.mean([np.array(one.crashed) > 0 for one in every])),
            forfeits=_rounded(np.mean([np.array(one.outcomes) == FORFEIT for one in every])),
        )

    def _worths(self, one: Round) -> Float[np.ndarray, " arenas"]:
        won = np.isin(one.outcomes, PURSUER_WINS).astype(float)
        lost = np.isin(one.outcomes, evader_winning(time_limit_wins=True)).astype(float)
        worth = won - lost if self.role == Role.PURSUER else lost - won
        return np.where(np.array(one.outcomes) == FORFEIT, -1.0, worth)


@partial(jax.jit, static_argnames="role")
def _act(game: Game, pool: Any, games: rollout.Games, bits: Array, role: Role) -> Any:
    return rollout.decide(pool, games.sides[role], perceive(pool.observation, game, games.state, role), bits[role])


def digest_of(name: str, agent: Named | None = None) -> tuple[str, str]:
    """Return a player's name and the SHA-256 of its file, an agent's from outside as it was read; of one without a file
    that of nothing.
    """
    if agent and (process := process_of(agent.policy)):
        return name, sha256(process.content).hexdigest()
    path = file_of(name.removeprefix(SHIELDED).removeprefix(SEARCHING))
    return name, sha256(path.read_bytes() if path and os.path.isfile(path) else b"").hexdigest()


def _rounded(value: Any) -> float:
    return round(float(value), 4)
