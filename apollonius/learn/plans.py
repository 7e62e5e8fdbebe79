"""The stages of a run by name: the plan of each, and the agents that they go on from."""

from apollonius.agents.network import Network
from apollonius.agents.trained import load_network
from apollonius.game.types import Role
from apollonius.learn.algorithm import fitted
from apollonius.learn.config import RunConfig
from apollonius.learn.devices import share
from apollonius.learn.stage_config import StageConfig
from apollonius.learn.train_state import Plan

FIXED_TARGET, SELF_PLAY, DISTILLATION = STAGES = "fixed-target", "self-play", "distillation"


def plans_of(config: RunConfig) -> dict[str, Plan]:
    """The stages of a run in their order, by name: each device's share of them.

    Raises:
        InvalidInput: when there are not so many devices, or a number cannot be shared out between them.
    """
    stages: dict[str, StageConfig] = {
        FIXED_TARGET: config.fixed_target,
        SELF_PLAY: config.self_play,
        DISTILLATION: config.distillation,
    }
    asked = [FIXED_TARGET, SELF_PLAY] if config.stages == "both" else [config.stages]
    return {stage: share(Plan(config.learner, stages[stage]), config.devices) for stage in asked}


def load_first(config: RunConfig, role: Role) -> Network | None:
    """The network that a side goes on from, if the config names one.

    Raises:
        InvalidInput: when there is no such agent, or its network is not of the kind that the config trains.
    """
    name = config.first[role]
    if name is None:
        return None
    return fitted(load_network(name, role), config.self_play.learner_of(role, config.learner), role.name.lower(), name)
