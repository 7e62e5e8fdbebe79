"""How much the agents of a run lose: to responses that learn to beat them, and to the paper's agents."""

from dataclasses import dataclass
from pathlib import Path

from apollonius.agents.kind import Named
from apollonius.agents.policy import AbstractPolicy
from apollonius.arenas.record import to_dict
from apollonius.catalogue import find_player
from apollonius.evaluate.match import Match, MatchResult, play_match
from apollonius.evaluate.match_cache import cached_result
from apollonius.evaluate.statistics import wilson_interval
from apollonius.exploit.attack import Attack
from apollonius.exploit.responses import cached_response, train_response
from apollonius.game.by_side import BySide
from apollonius.game.types import Role
from apollonius.jobs import ShouldStop
from apollonius.learn.folder import agent_file, load_config
from apollonius.learn.learner_config import DQNConfig
from studies.driver import LAST

ZOO = BySide(("P_curriculum", "P_scratch"), ("E_curriculum", "E_scratch"))
"""The paper's agents of either side."""
FIRST: BySide[str | None] = ZOO.map(lambda names: names[0])
"""The agents that responses go on from."""
QUICK = DQNConfig(averaging=3e-3, games=256, replay_capacity=262_144)
"""How a response learns in some hundred thousand env steps: its weights are averaged over three hundred updates."""


@dataclass(frozen=True)
class Effort:
    """How thoroughly runs are judged."""

    response_env_steps: int = 500_000
    """Training of a response to a final agent; responses to earlier ones get half."""
    games: int = 500
    """Games that judge a response, and in each match with an agent of the zoo."""


@dataclass(frozen=True)
class LossRate:
    """How often an agent loses to one opponent: a rate with its Wilson 95 % interval, and the match."""

    rate: float
    interval: tuple[float, float]
    match: MatchResult


def measure_loss(attack: Attack, opponent: AbstractPolicy, games: int) -> LossRate:
    """How often the agent loses to any opponent. A pursuer loses every game that it does not win."""
    players = BySide.of(attack.role, attack.player, Named("opponent", opponent))
    match = play_match(Match(attack.rules, players, games), slots=64)
    won = round(match.pursuer_win_rate * games)
    lost = games - won if attack.role == Role.PURSUER else won
    return LossRate(lost / games, wilson_interval(lost, games), match)


@dataclass(frozen=True)
class Judgement:
    """How often an agent loses to each of its opponents, by their names."""

    against: dict[str, LossRate]

    @property
    def most(self) -> float:
        """The largest rate: near a lower bound of its exploitability, a little too large as the largest of several."""
        return max(loss.rate for loss in self.against.values())


def judge_run(run: Path, effort: Effort, whole_curve: bool, should_stop: ShouldStop) -> bool:
    """Judge both agents of a run, each once. Returns False if it was stopped.

    Args:
        run: a finished run of self-play from a given pursuer.
        whole_curve: judge all agents that were kept on the way, not the last ones only.
    """
    percents = kept_percents(run)
    for percent in reversed(percents if whole_curve else percents[-1:]):
        for role in Role:
            if should_stop():
                return False
            judge(run, role, percent, effort)
    return True


def kept_percents(run: Path) -> tuple[int, ...]:
    """The percentages of a run's self-play at which its agents were kept."""
    return load_config(run / "config.toml").self_play.snapshot_percents


def judged(run: Path, role: Role) -> list[int]:
    """The percentages of a run's self-play whose agents have been judged."""
    return [percent for percent in kept_percents(run) if _file(run, role, percent).exists()]


def judge(run: Path, role: Role, percent: int, effort: Effort) -> Judgement:
    """How often an agent loses to a response that learned to beat it, and to the paper's agents."""
    attack = Attack(
        role,
        str(agent_file(run, LAST[role], percent)),
        env_steps=effort.response_env_steps // (1 if percent == 100 else 2),
        first=FIRST[role.other],
        learner=QUICK,
    )

    def losses() -> Judgement:
        folder = run / "responses" / _file(run, role, percent).stem
        train_response(attack, folder, seed=0)
        against = {"response": measure_loss(attack, cached_response(attack, folder, 0), effort.games)}
        for name in ZOO[attack.role.other]:
            against[name] = measure_loss(attack, find_player(name, attack.role.other).policy, effort.games)
        return Judgement(against)

    asked = attack.record | {"games": effort.games, "opponents": ZOO[attack.role.other], "dqn": to_dict(QUICK)}
    return cached_result(_file(run, role, percent), asked, Judgement, losses)


def _file(run: Path, role: Role, percent: int) -> Path:
    return run / "judged" / f"{role.name.lower()}-{percent}.json"
