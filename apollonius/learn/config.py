"""The configuration of a training run, saved as `config.toml` and read back strictly; presets and
sweeps.
"""

import difflib
import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from apollonius.arenas.file import from_dict, to_dict
from apollonius.game.game import Game
from apollonius.game.presets import make_game
from apollonius.game.types import ROLES, BySide, Role
from apollonius.io.errors import InvalidInput, require
from apollonius.io.extensions import ALGORITHMS, load_extension, unfit_extension
from apollonius.io.limits import SEED, TRAININGS
from apollonius.io.record import Hooks
from apollonius.learn.algorithm import Algorithm
from apollonius.learn.distillation import DistillationConfig
from apollonius.learn.dqn import PROFILES, DQNConfig
from apollonius.learn.fixed_target import FixedTargetConfig
from apollonius.learn.ppo import PPOConfig
from apollonius.learn.replay_algorithm import ReplayAlgorithm
from apollonius.learn.response import ResponseConfig
from apollonius.learn.sac import SACConfig
from apollonius.learn.self_play import SelfPlayConfig
from apollonius.learn.stage import StageConfig

FIXED_TARGET = FixedTargetConfig.kind
SELF_PLAY = SelfPlayConfig.kind
_ALGORITHM = "a subclass of ReplayAlgorithm, of this name as its kind"
_STAGES: dict[str, type[StageConfig]] = {
    stage.kind: stage
    for stage in (FixedTargetConfig, SelfPlayConfig, DistillationConfig, ResponseConfig)
}
_ALGORITHMS: dict[str, type[Algorithm]] = {
    algorithm.kind: algorithm for algorithm in (DQNConfig, SACConfig, PPOConfig)
}


@dataclass(frozen=True)
class RunConfig:
    """A training run: the game, the algorithm, the stages."""

    seed: int = 0
    """Seed of everything random in the run."""
    game: Game = field(default_factory=lambda: make_game("paper"))
    """The game, number by number."""
    algorithm: Algorithm = field(default_factory=DQNConfig)
    """Algorithm by which each side learns."""
    stages: tuple[StageConfig, ...] = (FixedTargetConfig(), SelfPlayConfig())
    """The stages in their order: each starts from the agents of the earlier ones."""
    pursuer: str | None = None
    """Agent that the pursuer starts from; None for random weights. Where `team` is trained, one
    that reads `egocentric` is extended by weights of 0 for what is new.
    """
    evader: str | None = None
    """Agent that the evader starts from; None for random weights."""

    def __post_init__(self) -> None:
        SEED.require("seed", self.seed)
        require(len(self.stages) >= 1, "stages", "none", "one at least")
        if self.algorithm.continuous:
            self.game.require_two(f"'{self.algorithm.kind}', whose actions are continuous")
        for stage in self.stages:
            stage.check(self.algorithm, self.game)
        trained = {role for stage in self.stages for role in stage.roles}
        for role in Role:
            agent, side = self.first_agents[role], role.name.lower()
            bound = f"left out where no {side} learns"
            require(agent is None or role in trained, side, agent, bound)

    @property
    def first_agents(self) -> BySide[str | None]:
        """The agents that both sides start from."""
        return BySide(self.pursuer, self.evader)

    @property
    def is_judged(self) -> bool:
        """True if matches between its agents judge the run at the end."""
        return any(stage.is_judged for stage in self.stages)

    @property
    def by_name(self) -> dict[str, StageConfig]:
        """The stages by their names: their kinds, with numbers where several are of one kind."""
        return dict(
            zip(_stage_names([stage.kind for stage in self.stages]), self.stages, strict=True)
        )

    def agent_name(self, name: str, role: Role) -> str:
        """Return the name of the agent of a side that a stage trains, as P_curriculum."""
        stage = self.by_name[name]
        is_first = next(iter(self.by_name)) == name and self.pursuer is None
        _, _, number = name.removeprefix(stage.kind).partition("-")
        return f"{role.name[0]}_{stage.agent_kind(is_first)}{number and '_' + number}"

    def stage_number(self, name: str) -> int:
        """Return the number of a stage that its random key is made with: by its kind, and how many
        of its kind come before.
        """
        number = list(self.by_name).index(name)
        kind = self.stages[number].kind
        repeats = sum(earlier.kind == kind for earlier in self.stages[:number])
        return list(_STAGES).index(kind) + len(_STAGES) * repeats

    def sides_with_networks(self, name: str) -> BySide[bool]:
        """Tell the sides that have a network before a stage: from an agent, or from an earlier
        stage.
        """
        names = list(self.by_name)
        before = self.stages[: names.index(name)]
        trained = {role for stage in before for role in stage.roles}
        return ROLES.map(lambda role: self.first_agents[role] is not None or role in trained)

    def share(self, name: str, env_steps: int) -> float:
        """Return the share of the whole training that is done after some env steps of a stage;
        raises InvalidInput for a stage of another training. The work of a stage is its env steps,
        once for each side that learns.
        """
        stages = self.by_name
        require(name in stages, "stage", name, f"one of this training, {', '.join(stages)}")
        work = {name: len(stage.roles) * stage.env_steps for name, stage in stages.items()}
        names = list(stages)
        before = sum(work[earlier] for earlier in names[: names.index(name)])
        done = work[name] * stages[name].share(self.algorithm, env_steps)
        return (before + done) / sum(work.values())


def _stage_names(kinds: Sequence[str]) -> list[str]:
    """Return the names of stages: their kinds, with numbers where several are of one kind."""
    numbers = [kinds[: index + 1].count(kind) for index, kind in enumerate(kinds)]
    return [
        kind if number == 1 else f"{kind}-{number}"
        for kind, number in zip(kinds, numbers, strict=True)
    ]


def register_algorithm(algorithm: type[Algorithm]) -> None:
    """Make an algorithm known by its `kind`, so that configs can be read that name it; raises
    InvalidInput where another one has that name.
    """
    registered = _ALGORITHMS.setdefault(algorithm.kind, algorithm)
    bound = "a name that no other algorithm has"
    require(registered == algorithm, "kind", algorithm.kind, bound)


def read_config(data: dict[str, Any], source: str) -> RunConfig:
    """Return the config of a record, as of a `config.toml`; raises InvalidInput for a bad one."""

    def read_algorithm(value: Any) -> Any:
        if isinstance(value, dict) and isinstance(value.get("kind"), str):
            _import_algorithm(value["kind"])
        return _read_kind(value, "algorithm", _ALGORITHMS, hooks)

    hooks: Hooks = {
        Algorithm: read_algorithm,
        StageConfig: lambda value: _read_kind(value, "stages", _STAGES, hooks),
    }
    return from_dict(RunConfig, data, source, hooks=hooks)


def _import_algorithm(kind: str) -> None:
    """Register the algorithm of another package, if one has this name and none is known by it;
    raises InvalidInput for a broken one.
    """
    if kind in _ALGORITHMS:
        return
    part = load_extension(ALGORITHMS, kind, _ALGORITHM)
    if part is None:
        return
    is_algorithm = isinstance(part, type) and issubclass(part, ReplayAlgorithm)
    if not is_algorithm or part.kind != kind:
        raise unfit_extension(ALGORITHMS, kind, _ALGORITHM, part)
    register_algorithm(part)


def _read_kind(value: Any, name: str, kinds: Mapping[str, type[Any]], hooks: Hooks) -> Any:
    """Read an algorithm or a stage by the class of its kind."""
    if not isinstance(value, dict):
        return value
    require("kind" in value, f"{name}: kind", "nothing", f"one of {', '.join(kinds)}")
    kind = value["kind"]
    chosen = kinds.get(kind) if isinstance(kind, str) else None
    require(chosen is not None, f"{name}: kind", kind, f"one of {', '.join(kinds)}")
    assert chosen is not None
    return from_dict(chosen, value, f"{name}, {kind}", hooks=hooks)


PRESETS: dict[str, RunConfig] = {
    "paper": RunConfig(),
    "standard": RunConfig(
        stages=(FixedTargetConfig(env_steps=6_000_000), SelfPlayConfig(env_steps=8_000_000))
    ),
    "quick": RunConfig(
        algorithm=DQNConfig(width=128, depth=3, learning_rate=3e-3, exploration_fraction=0.1),
        stages=(
            FixedTargetConfig(env_steps=8_000_000, evaluations=8, evaluation_games=500),
            SelfPlayConfig(env_steps=6_000_000, evaluations=8, evaluation_games=500),
        ),
    ),
}
"""`quick`: a small network, two to five minutes of a core. `standard`: some three times that.
`paper`: about the paper's 200,000 + 300,000 episodes.
"""


def change_stages(config: RunConfig, kind: str, **changes: Any) -> RunConfig:
    """Return a config with changed fields in all stages of a kind."""
    stages = (replace(stage, **changes) if stage.kind == kind else stage for stage in config.stages)
    return replace(config, stages=tuple(stages))


def with_profile(config: RunConfig, profile: str) -> RunConfig:
    """Set how DQN learns by the name of a profile; `paper` also sets c and T of stage 1, which the
    paper leaves open.

    With c = 3 and games of 1,000 steps whose last state is bootstrapped, the values of standing
    still grow beyond all returns.
    """
    changed = replace(config, algorithm=PROFILES[profile])
    if profile != "paper":
        return changed
    return change_stages(
        changed, FIXED_TARGET, progress=10.0, time_limit=200, limit_terminates=True
    )


def sweep(config: RunConfig, values: Mapping[str, Sequence[Any]]) -> dict[str, RunConfig]:
    """Return the trainings of a sweep by name, as `algorithm.batch=64,seed=3`: all combinations of
    the values of fields, by their dotted paths, in which a stage goes by its name
    (`stages.self-play.renewal`, `stages.self-play-2.renewal`).

    Raises InvalidInput for an unknown field, an impossible value, and too many trainings.
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
        runs[name] = read_config(data, name)
    require(len(runs) == len(combinations), "values", ", ".join(runs), "different ones")
    return runs


def _in_name(value: Any) -> str:
    text = f"{value:g}" if isinstance(value, float) else str(value)
    return "".join(letter if letter.isalnum() or letter in "+-._" else "-" for letter in text)


def _set(data: dict[str, Any], field: str, value: Any) -> None:
    """Set a field of a config's record; one that is misspelt is refused when the record is read."""
    *tables, key = field.split(".")
    inner: Any = data
    for table in tables:
        inner = _tables_in(inner).get(table)
        if inner is None:
            near = difflib.get_close_matches(field, _dotted(data), n=1, cutoff=0.0)[0]
            raise InvalidInput(f"the training has no field '{field}'; did you mean '{near}'?")
    inner[key] = value


def _tables_in(record: Any) -> dict[str, Any]:
    """Return the tables within a table, or of a list of stages by their names."""
    if isinstance(record, list):
        return dict(zip(_stage_names([table["kind"] for table in record]), record, strict=True))
    return {
        name: value
        for name, value in record.items()
        if isinstance(value, dict) or (name == "stages" and isinstance(value, list))
    }


def _dotted(record: Any) -> list[str]:
    """List the dotted paths of all fields."""
    tables = _tables_in(record)
    plain = [] if isinstance(record, list) else [name for name in record if name not in tables]
    inner = [f"{name}.{path}" for name, table in tables.items() for path in _dotted(table)]
    return plain + inner
