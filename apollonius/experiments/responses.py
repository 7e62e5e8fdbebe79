"""Responses: opponents that learn to beat one agent, kept as files and not trained twice, and what they win."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from apollonius.agents.catalogue import Named, fingerprint, load_network
from apollonius.agents.network import Network
from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.store import describe, load_agent, save_agent
from apollonius.agents.trained import at_best
from apollonius.errors import require
from apollonius.evaluate.match import MatchResult, play_match
from apollonius.evaluate.statistics import wilson_interval
from apollonius.experiments.jobs import ShouldStop
from apollonius.game.file import find_game
from apollonius.game.game import Game
from apollonius.game.record import to_dict
from apollonius.game.types import Role
from apollonius.learn.algorithm import require_fitting
from apollonius.learn.best_response import best_response
from apollonius.learn.config import SelfPlayConfig
from apollonius.learn.learner_config import DQNConfig
from apollonius.learn.state import Plan
from apollonius.playout import Report
from apollonius.solve.catalogue import find_player


@dataclass(frozen=True)
class Attack:
    """Whom responses are trained against, and how. Plain data, so that any process can do it.

    Attributes:
        role: the side that the attacked agent plays.
        agent: its name or file.
        game: name or file of the game.
        env_steps: length of each response's training.
        first: trained agent that responses go on from; None starts them from random weights.
        dqn: how they learn.
    """

    role: Role
    agent: str
    game: str = "paper"
    env_steps: int = 4_000_000
    first: str | None = None
    dqn: DQNConfig = field(default_factory=DQNConfig)

    @property
    def other(self) -> Role:
        """The side that responses play."""
        return Role.EVADER if self.role == Role.PURSUER else Role.PURSUER

    @property
    def plan(self) -> Plan:
        """How a response learns."""
        epsilon = 0.2 if self.first else 1.0
        return Plan(self.dqn, SelfPlayConfig(env_steps=self.env_steps, pursuer_epsilon=epsilon, evader_epsilon=epsilon))

    @cached_property
    def rules(self) -> Game:
        """The game that is played."""
        return find_game(self.game)

    @cached_property
    def player(self) -> Named:
        """The attacked agent."""
        return find_player(self.agent, self.role, self.rules)

    @cached_property
    def start(self) -> Network | None:
        """The network that responses go on from."""
        if self.first is None:
            return None
        network = load_network(self.first, self.other)
        require_fitting(network, self.dqn, "the agent that responses go on from", self.first)
        return network

    @cached_property
    def record(self) -> dict[str, Any]:
        """What tells its responses from those of another attack."""
        # Two runs give their agents the same names, so the weights tell whom a response was trained against.
        asked = {"against": self.player.name, "fingerprint": fingerprint(self.player.policy), "first": self.first}
        return asked | {"env_steps": self.env_steps, "game": self.game}


def response_file(folder: Path, seed: int) -> Path:
    """Where the response of a seed is kept."""
    return folder / f"response-{seed}.safetensors"


def train_response(
    attack: Attack,
    folder: Path,
    seed: int,
    should_stop: ShouldStop = lambda: False,
    report: Report = lambda done, total: None,
) -> bool:
    """Train the response of a seed, unless it lies in the folder already. Returns False if there was no time to begin.

    Args:
        report: as of `best_response`.

    Raises:
        InvalidInput: when responses to another agent, or other ones, lie in the folder.
    """
    path = response_file(folder, seed)
    if path.exists():
        made = {name: load_agent(path).header.training.get(name) for name in attack.record}
        bound = f"another folder: here lie responses to {made['against']}, or other ones"
        same = made | {"against": attack.record["against"]} == attack.record  # weights tell agents, not their names
        require(same, "--out", folder, bound)
        return True
    if should_stop():
        return False
    policy, other = attack.player.policy, attack.other
    network = best_response(attack.plan, attack.rules, policy, other, seed, attack.start, report)
    folder.mkdir(parents=True, exist_ok=True)
    training = {"command": "apollonius exploit", "seed": seed, **attack.record, "stage": asdict(attack.plan.stage)}
    save_agent(describe(network, attack.other, to_dict(attack.rules), training), path)
    return True


CHOOSING, JUDGING = 0, 1
"""Seeds of the games by which an opponent is chosen, and of those by which the chosen one is judged."""


@dataclass(frozen=True)
class Loss:
    """How often the attacked agent loses to one opponent: a rate with its Wilson 95 % interval, and the match."""

    rate: float
    interval: tuple[float, float]
    match: MatchResult


def judge_response(
    attack: Attack, folder: Path, seed: int, games: int, report: Report = lambda done, total: None
) -> Loss:
    """How often the agent loses to a kept response. The starts are others than in training."""
    return judge_opponent(attack, kept_response(folder, seed), games, report=report)


def kept_response(folder: Path, seed: int) -> AbstractPolicy:
    """The player by the response of a seed, which lies in the folder."""
    return at_best(load_agent(response_file(folder, seed)).network)


def judge_opponent(
    attack: Attack,
    opponent: AbstractPolicy,
    games: int,
    seed: int = CHOOSING,
    report: Report = lambda done, total: None,
) -> Loss:
    """How often the agent loses to any opponent. A pursuer loses every game that it does not win."""
    players = [attack.player.policy, opponent]
    pursuer, evader = players if attack.role == Role.PURSUER else players[::-1]
    match = play_match(attack.rules, pursuer, evader, games, seed, slots=64, report=report)
    won = round(match.pursuer_win_rate * games)
    lost = games - won if attack.role == Role.PURSUER else won
    return Loss(lost / games, wilson_interval(lost, games), match)


def judge_strongest(
    attack: Attack,
    opponents: Mapping[str, AbstractPolicy],
    losses: Mapping[str, Loss],
    report: Report = lambda done, total: None,
) -> tuple[str, Loss]:
    """The opponent that the agent loses to most often, and how often it loses to it in as many games on other starts.

    The largest of several rates is too large on average: whoever was lucky is chosen. Games by which nobody was chosen
    are not biased so, and the lower end of their interval is a bound of what the agent can lose.
    """
    name = max(losses, key=lambda one: losses[one].rate)
    return name, judge_opponent(attack, opponents[name], losses[name].match.games, JUDGING, report)
