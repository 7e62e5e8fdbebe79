"""The games of a stage in which one side learns, and its opponents there."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import equinox as eqx

from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.source import NamedPlayer
from apollonius.arenas.charting import largest_radius, with_chart
from apollonius.catalogue import TABLE, find_player
from apollonius.game.game import Game
from apollonius.game.types import Real, Role
from apollonius.io.errors import require
from apollonius.learn.algorithm import LearnerConfig
from apollonius.learn.ppo_config import PPOConfig
from apollonius.learn.stage_config import OneSideConfig, ResponseConfig
from apollonius.observe.registry import find_observation

Players = dict[tuple[str, Role], NamedPlayer]
"""Players by name and side."""


class TrainingTask(eqx.Module):
    """A game, the learner's opponents in it, each in an equal part of the games, and what a lost
    game costs in the learner's values.
    """

    game: Game
    opponents: tuple[AbstractPolicy, ...]
    loss_value: Real


def equal_parts(games: int, kinds: int) -> list[int]:
    """Divide games between kinds of opponents: equally, with one more for each of the first if need
    be.
    """
    return [games // kinds + (number < games % kinds) for number in range(kinds)]


def training_tasks(stage: ResponseConfig, learner: PPOConfig, game: Game) -> list[TrainingTask]:
    """Return the run's own game and the further tasks; raises InvalidInput when an opponent cannot
    be found, and where a clearance margin is wanted of a network that knows no room to brake.
    """
    require_room_to_brake(stage, learner)
    reads = find_observation(learner.observation).needs_chart
    charted_games = list[Game]()
    tasks = list[TrainingTask]()
    other = stage.side.other
    for game_of_task, names in stage.line_ups(game):
        charted_games.append(_with_chart_like(game_of_task, charted_games, reads))
        task_game, players = resolve_players(stage.trained_in(charted_games[-1]), names)
        tasks.append(
            TrainingTask(
                task_game,
                tuple(players[name, other].policy for name in names[other]),
                learner.loss_value,
            )
        )
    return tasks


def require_room_to_brake(stage: OneSideConfig, learner: LearnerConfig) -> None:
    """Refuse a clearance margin of a network whose observation does not have the room to brake."""
    reads, bound = (
        learner.observation,
        "egocentric or team, which know the room to brake, or no clearance_margin",
    )
    require(
        stage.clearance_margin == 0 or find_observation(reads).needs_chart,
        "observation",
        reads,
        bound,
    )


def _with_chart_like(game: Game, references: Sequence[Game], are_read: bool) -> Game:
    """Return a game with the charts of another one in the same arenas and with as large robots, or
    with its own.
    """
    for other in references:
        own_scenario, other_scenario = game.scenario, other.scenario
        if (
            own_scenario
            and other_scenario
            and own_scenario.name
            and own_scenario.name == other_scenario.name
            and largest_radius(game) == largest_radius(other)
        ):
            return replace(game, scenario=replace(own_scenario, arenas=other_scenario.arenas))
    return with_chart(game, are_read)


def resolve_players(game: Game, names: Mapping[Role, Sequence[str]]) -> tuple[Game, Players]:
    """Return a game, with charts where its players of these names read them, and these; `TABLE` is
    nobody here.
    """
    players = _find(game, names)
    return with_chart(game, any(player.policy.needs_chart for player in players.values())), players


def _find(game: Game, names: Mapping[Role, Sequence[str]]) -> Players:
    requested = {(name, role) for role in names for name in names[role] if name != TABLE}
    return {each: find_player(*each, game) for each in requested}


def require_players(stage: OneSideConfig, game: Game) -> None:
    """Refuse, by InvalidInput, opponents and a teacher that cannot be found."""
    for task_game, names in stage.line_ups(game):
        _find(task_game, names)
