"""The configuration of a training run, saved as `config.toml` and read back strictly; presets and
sweeps.
"""

import difflib
import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from apollonius.arenas.file import from_dict, to_dict
from apollonius.game.game import Game
from apollonius.game.presets import make_game
from apollonius.game.types import BySide, Role
from apollonius.io.errors import InvalidInput, require
from apollonius.io.limits import SEED, TRAININGS, require_memory
from apollonius.learn.algorithm import LearnerConfig
from apollonius.learn.dqn import PROFILES, DQNConfig
from apollonius.learn.ppo_config import PPOConfig
from apollonius.learn.sac import SACConfig
from apollonius.learn.stage_config import (
    DistillationConfig,
    OneSideConfig,
    Plan,
    ResponseConfig,
    SelfPlayConfig,
    StageConfig,
)

FIXED_TARGET = "fixed-target"
SELF_PLAY = "self-play"
DISTILLATION = "distillation"
RESPONSE = "response"
STAGES = (FIXED_TARGET, SELF_PLAY, DISTILLATION, RESPONSE)


def require_pay_in_play(game: Game, role: Role) -> None:
    """Refuse to train a team by a reward that comes after its robots can be out of play: in the
    zero-sum profile.

    A robot learns until it is out of play. By that profile it would not learn that its side lost or
    won after that, and leaving early would cost nothing.
    """
    paid = len(game.bodies[role]) == 1 or game.reward.profile != "zero-sum"
    require(
        paid,
        "reward.profile",
        game.reward.profile,
        "'paper' for a team that learns, which pays robots in play",
    )


@dataclass(frozen=True)
class RunConfig:
    """A training run: the game, the algorithm, the stages."""

    seed: int = 0
    """Seed of everything random in the run."""
    stages: Literal["fixed-target", "self-play", "both", "distillation", "response"] = "both"
    """Algorithm 1, Algorithm 2 with both sides from scratch, or the curriculum of both; or one side
    from a teacher, or against opponents that do not learn.
    """
    game: Game = field(default_factory=lambda: make_game("paper"))
    """The game, number by number."""
    dqn: DQNConfig = field(default_factory=DQNConfig)
    """How each side learns, by deep Q-learning, unless `sac` is given."""
    sac: SACConfig | None = None
    """The numbers of soft actor-critic, whose actions are continuous; None for other algorithms."""
    ppo: PPOConfig = field(default_factory=PPOConfig)
    """The algorithm by which the side of a response learns, proximal policy optimisation."""
    fixed_target: StageConfig = field(default_factory=StageConfig)
    """Stage 1: the pursuer against evaders that do not learn."""
    self_play: SelfPlayConfig = field(default_factory=SelfPlayConfig)
    """Stage 2: both against each other."""
    distillation: DistillationConfig = field(default_factory=DistillationConfig)
    """One side from a teacher."""
    response: ResponseConfig = field(default_factory=ResponseConfig)
    """One side against opponents that do not learn."""
    evaders: tuple[str, ...] = ("still",)
    """Players that the pursuer of stage 1 learns to catch: `still`, as in Algorithm 1, or others,
    of whom each game meets one.
    """
    pursuer: str | None = None
    """Agent that the pursuer of a lone stage starts from; None is from scratch. Where `team` is
    trained, one that reads `egocentric` is extended by weights of 0 for what is new."""
    evader: str | None = None
    """Agent that the evader of a lone stage starts from; None is from scratch (Algorithm 2)."""

    def __post_init__(self) -> None:
        SEED.require("seed", self.seed)
        if self.sac is not None:
            self.game.require_two("soft actor-critic")
        for role in (Role.PURSUER,) if self.stages == FIXED_TARGET else Role:
            require_pay_in_play(self.game, role)
        self._check_past_opponents()
        self._check_first_networks()
        if self.one_side is not None:
            bound = f"left out for a {self.stages}, whose actions are the nine"
            require(self.sac is None, "sac", "given", bound)
        if self.stages == RESPONSE:
            self._check_response()
        if self.stages == DISTILLATION:
            self._check_distillation()

    def _check_past_opponents(self) -> None:
        """Refuse earlier versions that games, memory or the time between two draws do not suffice
        for.
        """
        past = self.self_play.opponents
        learner = self.sac or self.dqn
        games = learner.games
        fits = past.share == 0 or past.slot_games(games) > 0
        require(
            fits,
            "games",
            games,
            f"more, so that {past.scheme} has one for each of 2 x {past.slots} slots",
        )
        copies = 2 * past.versions * (past.share > 0)
        needed = copies * 4 * learner.depth * learner.width**2
        require_memory("versions", past.versions, needed, "keep fewer, or train a smaller network")
        longest = games * self.game.max_steps
        bound = (
            f"at least games x max_steps = {longest:,}, so that games that {past.scheme} "
            "judges by can end"
        )
        require(past.renewal >= longest or past.share == 0, "renewal", past.renewal, bound)

    def _check_first_networks(self) -> None:
        """Refuse agents to start from, and evaders, that the stages do not use."""
        used = {FIXED_TARGET: ("pursuer", "evaders"), "both": ()}.get(
            self.stages, ("pursuer", "evader")
        )
        for name, default in (("pursuer", None), ("evader", None), ("evaders", ("still",))):
            value = getattr(self, name)
            bound = f"left out where stages is '{self.stages}', which begins without it"
            shown = ", ".join(value) if name == "evaders" else value
            require(value == default or name in used, name, shown, bound)

    def _check_response(self) -> None:
        games, bound = self.ppo.games, "as many at least as opponents, so that each has one"
        require(games >= len(self.response.opponents), "ppo.games", games, bound)
        first = BySide(self.pursuer, self.evader)[self.response.side]
        share = self.response.initial_weight_share
        bound = "0 for an agent from random weights"
        require(first or share == 0, "response.initial_weight_share", share, bound)

    def _check_distillation(self) -> None:
        stage, games = self.distillation, self.dqn.games
        if stage.solves:
            self.game.require_two("a distillation by tables")
        attackers = stage.near_sighted + stage.far_sighted
        bound = f"more than the {attackers} of its attackers, so that each opponent has one"
        require(games - attackers >= len(stage.opponents), "games", games, bound)

    @property
    def stage1_name(self) -> str:
        """The name of the pursuer that learned to catch the evaders of stage 1."""
        if self.evaders == ("still",):
            return "P_stage1"
        return f"P_{Path(self.evaders[0]).stem}" if len(self.evaders) == 1 else "P_pool"

    @property
    def kind(self) -> str:
        """The name of agents of the last stage after their side, as in P_curriculum."""
        if self.one_side is not None:
            return {DISTILLATION: "distilled", RESPONSE: "response"}[self.stages]
        return "scratch" if self.stages == SELF_PLAY and self.pursuer is None else "curriculum"

    @property
    def one_side(self) -> OneSideConfig | None:
        """The stage in which one side learns, if that is the one."""
        return {DISTILLATION: self.distillation, RESPONSE: self.response}.get(self.stages)

    @property
    def learner(self) -> LearnerConfig:
        """The numbers of the algorithm that learns."""
        return self.ppo if self.stages == RESPONSE else self.sac or self.dqn

    @property
    def plans(self) -> dict[str, Plan]:
        """The plans of the stages in their order, by name; the tasks of a response are in its
        settings.
        """
        of_one_side = self.distillation, replace(self.response, tasks=())
        stages = (self.fixed_target, self.self_play, *of_one_side)
        selected = STAGES[:2] if self.stages == "both" else [self.stages]
        return {
            name: Plan(self.learner, stage)
            for name, stage in zip(STAGES, stages, strict=True)
            if name in selected
        }

    def share(self, stage: str, env_steps: int) -> float:
        """Return the share of the whole training that is done after some env steps of a stage;
        raises InvalidInput for a stage of another training. The work of a stage is its env steps,
        once for each side that learns.
        """
        plans = self.plans
        require(stage in plans, "stage", stage, f"one of this training, {', '.join(plans)}")
        work = {
            name: (2 if name == SELF_PLAY else 1) * plan.stage.env_steps
            for name, plan in plans.items()
        }
        before = sum(work[name] for name in STAGES[: STAGES.index(stage)] if name in work)
        return (before + work[stage] * plans[stage].share(env_steps)) / sum(work.values())


PRESETS: dict[str, RunConfig] = {
    "paper": RunConfig(),
    "standard": RunConfig(
        fixed_target=StageConfig(env_steps=6_000_000), self_play=SelfPlayConfig(env_steps=8_000_000)
    ),
    "quick": RunConfig(
        dqn=DQNConfig(width=128, depth=3, learning_rate=3e-3, exploration_fraction=0.1),
        fixed_target=StageConfig(env_steps=8_000_000, evaluations=8, evaluation_games=500),
        self_play=SelfPlayConfig(env_steps=6_000_000, evaluations=8, evaluation_games=500),
    ),
}
"""`quick`: a small network, two to five minutes of a core. `standard`: some three times that.
`paper`: about the paper's 200,000 + 300,000 episodes.
"""


def with_profile(config: RunConfig, profile: str) -> RunConfig:
    """Set how DQN learns by the name of a profile; `paper` also sets c and T of stage 1, which the
    paper leaves open.

    With c = 3 and games of 1,000 steps whose last state is bootstrapped, the values of standing
    still grow beyond all returns.
    """
    changed = replace(config, dqn=PROFILES[profile])
    if profile != "paper":
        return changed
    stage1 = replace(config.fixed_target, progress=10.0, time_limit=200, limit_terminates=True)
    return replace(changed, fixed_target=stage1)


def sweep(config: RunConfig, values: Mapping[str, Sequence[Any]]) -> dict[str, RunConfig]:
    """Return the trainings of a sweep by name, as `dqn.batch=64,seed=3`: all combinations of the
    values of fields, by their dotted paths; raises InvalidInput for an unknown field, an impossible
    value, and too many trainings.
    """
    TRAININGS.require("trainings", math.prod(map(len, values.values())))
    combinations = list(itertools.product(*values.values()))
    runs: dict[str, RunConfig] = {}
    for combination in combinations:
        changes = dict(zip(values, combination, strict=True))
        name = ",".join(f"{field}={_in_name(value)}" for field, value in changes.items())
        data = to_dict(config)
        for path, value in changes.items():
            _set(data, path, value)
        runs[name] = from_dict(RunConfig, data, name)
    require(len(runs) == len(combinations), "values", ", ".join(runs), "different ones")
    return runs


def _in_name(value: Any) -> str:
    text = f"{value:g}" if isinstance(value, float) else str(value)
    return "".join(letter if letter.isalnum() or letter in "+-._" else "-" for letter in text)


def _set(data: dict[str, Any], field: str, value: Any) -> None:
    """Set a field of a config's record; one that is misspelt is refused when the record is read."""
    *tables, key = field.split(".")
    inner = data
    for table in tables:
        if not isinstance(inner.get(table), dict):
            near = difflib.get_close_matches(field, _dotted(data), n=1, cutoff=0.0)[0]
            raise InvalidInput(f"the training has no field '{field}'; did you mean '{near}'?")
        inner = inner[table]
    inner[key] = value


def _dotted(data: dict[str, Any]) -> list[str]:
    inner = {
        name: _dotted(value) if isinstance(value, dict) else None for name, value in data.items()
    }
    return [
        f"{name}.{deeper}" if deeper else name
        for name, below in inner.items()
        for deeper in below or [""]
    ]
