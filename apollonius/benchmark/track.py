"""The benchmark: an agent against a fixed panel in the held-out arenas of a suite, a round being a
game in each.
"""

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

from apollonius.agents.names import bare_name
from apollonius.agents.onnx_agent import OnnxAgent, OnnxProcess, external_process
from apollonius.agents.source import NamedPlayer
from apollonius.agents.trained import agent_path
from apollonius.arenas.charting import with_chart
from apollonius.arenas.file import find_game, to_dict
from apollonius.arenas.suite import suite_entries
from apollonius.catalogue import find_player
from apollonius.evaluate.match import Match, draw_starts
from apollonius.evaluate.panels import PANELS
from apollonius.evaluate.result import worst_mean
from apollonius.evaluate.statistics import mean_interval
from apollonius.game.game import Game
from apollonius.game.outcome import PURSUER_WINS, evader_winning
from apollonius.game.presets import in_teams, make_game
from apollonius.game.types import BySide, Outcome, RobotStatus, Role
from apollonius.io.cache import digest
from apollonius.io.errors import require, require_printable
from apollonius.io.limits import ONNX
from apollonius.observe.knowledge import Knowledge
from apollonius.observe.observation import observation_rows
from apollonius.play import rollout
from apollonius.play.playout import AbstractWatcher, Results, play_out
from apollonius.play.rollout import Transition

SUITE, PART = "suite-v2", "held-out"
"""The arenas that are played in."""
ROUNDS = 2
"""Games in each arena against each opponent."""
FORFEIT = int(Outcome.ONGOING)
"""The outcome of a game in which an agent from outside failed; it counts as lost."""
_COURSE = re.compile("[0-9a-f]{16}")
_SLOTS = 32
_CALLS = 10


@dataclass(frozen=True)
class Round:
    """A game in each arena, in their order: its outcome, its length [steps], and the own robots
    that crashed or left.

    `seed` is the seed of the match, `course` a digest of all actions and rewards, `failure` the
    reason why an agent from outside forfeited games.
    """

    seed: int
    outcomes: tuple[int, ...]
    steps: tuple[int, ...]
    crashed: tuple[int, ...]
    course: str
    failure: str = field(compare=False)

    def __post_init__(self) -> None:
        outcomes_bound = "0, a forfeit, or how games end, 1 to 7"
        require(set(self.outcomes) <= {*Outcome}, "outcomes", self.outcomes, outcomes_bound)
        fewest_steps = min(self.steps, default=1)
        require(fewest_steps >= 1, "steps", fewest_steps, "1 at least")
        fewest_crashes = min(self.crashed, default=0)
        require(fewest_crashes >= 0, "crashed", fewest_crashes, "0 at least")
        require(_COURSE.fullmatch(self.course), "course", self.course, "16 hexadecimal digits")
        require_printable("failure", self.failure)
        forfeits = FORFEIT in self.outcomes
        failure_bound = "given where games are forfeited, only there"
        require(forfeits == bool(self.failure), "failure", self.failure, failure_bound)


@dataclass(frozen=True)
class Score:
    """The numbers of a card: the worth against the most difficult opponent, and shares of all
    games.

    The worth is the share of wins less the share of losses, where the time limit is the evader's
    win: the mean over the arenas with its 95 % interval, and the mean over their worst tenth.
    `crashes` is the share of games in which an own robot crashed or left, `forfeits` the share in
    which the agent failed to act.
    """

    net_win_rate: float
    interval: tuple[float, float]
    opponent: str
    worst_tenth: float
    crashes: float
    forfeits: float


class Fingerprint(AbstractWatcher):
    """A number that any other action or reward in a game changes (FNV-1a over words of 32 bits)."""

    def init(self) -> UInt32[Array, ""]:
        return jnp.uint32(0x811C9DC5)

    def update(self, statistic: UInt32[Array, ""], transition: Transition) -> UInt32[Array, ""]:
        for side in transition.sides:
            for leaf in (side.action, side.reward):
                for word in jax.lax.bitcast_convert_type(leaf, jnp.uint32).ravel():
                    statistic = (statistic ^ word) * jnp.uint32(0x01000193)
        return statistic


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
        return with_chart(in_teams(game, 2, 1) if self.track == "team" else game)

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

    def find(self, name: str) -> NamedPlayer:
        """Return the player of a name or a file; raises InvalidInput as `find_entry`."""
        return find_entry(name, self.role, self.game)

    def play(self, agent: NamedPlayer, opponent: str, seed: int) -> Round:
        """Play a round."""
        match, process = self._round(agent, opponent, seed)
        slots = match.games if process else _SLOTS
        results = play_out(
            match.rules, match.pools, *draw_starts(match), slots=slots, watcher=Fingerprint()
        )
        outcomes = np.array(results.outcome)
        steps = np.array(results.steps)
        crashes = self._crashed(results)
        if process:
            process.stop()
            outcomes[[*process.forfeited]] = FORFEIT
        fingerprints = np.asarray(results.watched)
        words = np.stack([outcomes, steps, crashes, fingerprints]).astype("<u4").tobytes()
        return Round(
            seed,
            outcomes=tuple(outcomes.tolist()),
            steps=tuple(steps.tolist()),
            crashed=tuple(crashes.tolist()),
            course=sha256(words).hexdigest()[:16],
            failure=process.reason if process else "",
        )

    def _round(
        self, agent: NamedPlayer, opponent: str, seed: int
    ) -> tuple[Match, OnnxProcess | None]:
        """Make the match of a round, and start the process of an agent from outside."""
        players = BySide.of(self.role, agent, self._opponents[opponent])
        match = Match(self.game, players, len(self.arenas), seed)
        process = external_process(agent.policy)
        if process:
            process.start_round(match.games)
        return match, process

    def microseconds(self, agent: NamedPlayer) -> float:
        """Measure the time of a decision [us]: the first step of all games of a round, over its
        decisions.
        """
        match, process = self._round(agent, self.panel[0], 0)
        starts, key = draw_starts(match)
        bits = jax.random.bits(key, (2, match.games))
        games = rollout.init_games(match.rules, starts, match.pools, bits)

        def decide() -> None:
            jax.block_until_ready(_act(match.rules, match.pools[self.role], games, bits, self.role))

        seconds = timeit.repeat(decide, number=1, repeat=_CALLS + 1)[1:]  # the first call compiles
        if process:
            process.stop()
        decisions = match.games * len(self.game.bodies[self.role])
        return _round_number(1e6 * float(np.median(seconds)) / decisions)

    @cached_property
    def _opponents(self) -> dict[str, NamedPlayer]:
        return {name: find_player(name, self.role.other, self.game) for name in self.panel}

    def _crashed(self, results: Results) -> np.ndarray:
        """Count the own robots that crashed or left in each game."""
        robots = np.stack([np.asarray(status) for status in results.status[self.role]])
        return np.isin(robots, (RobotStatus.HIT_OBSTACLE, RobotStatus.OUT_OF_RANGE)).sum(axis=0)

    def score(self, opponents: Mapping[str, Sequence[Round]]) -> Score:
        """Compute the score from rounds against each opponent."""
        worths = {
            name: np.mean([self._net_win_rates(game_round) for game_round in rounds], axis=0)
            for name, rounds in opponents.items()
        }
        against = min(worths, key=lambda name: float(np.mean(worths[name])))
        least = worths[against]
        all_rounds = [game_round for rounds in opponents.values() for game_round in rounds]
        low, high = mean_interval(least, -1.0, 1.0)
        return Score(
            net_win_rate=_round_number(np.mean(least)),
            interval=(_round_number(low), _round_number(high)),
            opponent=against,
            worst_tenth=_round_number(worst_mean(least)),
            crashes=_round_number(
                np.mean([np.array(game_round.crashed) > 0 for game_round in all_rounds])
            ),
            forfeits=_round_number(
                np.mean([np.array(game_round.outcomes) == FORFEIT for game_round in all_rounds])
            ),
        )

    def _net_win_rates(self, game_round: Round) -> Float[np.ndarray, " arenas"]:
        pursuer_wins = np.isin(game_round.outcomes, PURSUER_WINS).astype(float)
        evader_wins = np.isin(game_round.outcomes, evader_winning(time_limit_wins=True)).astype(
            float
        )
        wins = BySide(pursuer_wins, evader_wins)
        worth = wins[self.role] - wins[self.role.other]
        return np.where(np.array(game_round.outcomes) == FORFEIT, -1.0, worth)


def find_entry(name: str, role: Role, game: Game) -> NamedPlayer:
    """Return the player of a name or a file, which may be an ONNX model.

    Raises:
        InvalidInput: As `find_player` and `OnnxProcess`.
    """
    if name.endswith(ONNX):
        return NamedPlayer(Path(name).name, OnnxAgent(OnnxProcess(Path(name))))
    return find_player(name, role, game)


@partial(jax.jit, static_argnames="role")
def _act(game: Game, pool: Any, games: rollout.Games, bits: Array, role: Role) -> Any:
    observations = observation_rows(pool.observation, game, Knowledge.complete(games.state), role)
    return rollout.decide_actions(pool, games.sides[role], observations, bits[role])


def digest_of(name: str, agent: NamedPlayer | None = None) -> tuple[str, str]:
    """Return a player's name and the SHA-256 of its file, or of no bytes where it has none.

    The file of an agent from outside is taken as it was read.
    """
    process = external_process(agent.policy) if agent else None
    if process:
        return name, sha256(process.content).hexdigest()
    path = agent_path(bare_name(name))
    content = path.read_bytes() if path and os.path.isfile(path) else b""
    return name, sha256(content).hexdigest()


def _round_number(value: Any) -> float:
    return round(float(value), 4)
