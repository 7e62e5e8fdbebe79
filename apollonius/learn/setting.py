"""The games of a stage in which one side learns, and its opponents there."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import equinox as eqx

from apollonius.agents.kind import Named
from apollonius.agents.policy import AbstractPolicy
from apollonius.arenas.charting import charted, largest_radius
from apollonius.catalogue import TABLE, find_player
from apollonius.game.game import Game
from apollonius.game.types import Real, Role
from apollonius.io.errors import require
from apollonius.learn.learner_config import LearnerConfig
from apollonius.learn.ppo_config import PPOConfig
from apollonius.learn.stage_config import OneSideConfig, ResponseConfig, Task
from apollonius.observe.registry import find_observation

Players = dict[tuple[str, Role], Named]
"""Players by name and side."""


class Setting(eqx.Module):
    """A game, the learner's opponents in it, each in an equal part of the games, and what a lost game costs in the
    learner's values.
    """

    game: Game
    opponents: tuple[AbstractPolicy, ...]
    price: Real


def equal_parts(games: int, kinds: int) -> list[int]:
    """Return how many of some games each kind of opponents gets: as many, or one more in the first kinds."""
    return [games // kinds + (number < games % kinds) for number in range(kinds)]


def settings_of(stage: ResponseConfig, learner: PPOConfig, game: Game) -> list[Setting]:
    """Return the run's own game and the further tasks; raises InvalidInput when an opponent cannot be found, and where
    caution is wanted of a network that knows no room to brake.
    """
    require_room_to_brake(stage, learner)
    settings = list[Setting]()
    for task, known in tasks_of(stage, learner, Task(game, opponents=stage.opponents)):
        here, players = cast(stage.side, task, known)
        settings.append(Setting(here, opponents_in(players, task, stage.side), learner.price))
    return settings


def require_room_to_brake(stage: OneSideConfig, learner: LearnerConfig) -> None:
    """Refuse caution of a network whose observation does not have the room to brake."""
    reads, bound = learner.observation, "egocentric or team, which know the room to brake, or no caution"
    require(stage.caution == 0 or find_observation(reads).charted, "observation", reads, bound)


def tasks_of(stage: OneSideConfig, learner: LearnerConfig, own: Task) -> Iterator[tuple[Task, Game]]:
    """Yield the tasks of a stage, the run's own first, each with nothing left out, and its game as it is trained in."""
    known = list[Game]()
    for task in (own, *stage.tasks):
        known.append(_charted_as(task.game, known, find_observation(learner.observation).charted))
        whole = replace(task, teacher=task.teacher or own.teacher, opponents=task.opponents or own.opponents)
        yield whole, stage.trained_in(known[-1])


def _charted_as(game: Game, others: Sequence[Game], are_read: bool) -> Game:
    """Return a game with the charts of another one in the same arenas and with as large robots, or with its own."""
    for other in others:
        ours, theirs = game.scenario, other.scenario
        if ours and theirs and ours.name and ours.name == theirs.name and largest_radius(game) == largest_radius(other):
            return replace(game, scenario=replace(ours, arenas=theirs.arenas))
    return charted(game, are_read)


def cast(role: Role, task: Task, game: Game) -> tuple[Game, Players]:
    """Return a game, with charts where its players read them, and these: opponents, and the learner's teacher."""
    named: Iterable[tuple[str, Role]] = {(name, role.other) for name in task.opponents} | {(task.teacher, role)}
    players = {each: find_player(*each, game) for each in named if each[0] not in ("", TABLE)}
    return charted(game, any(player.policy.charted for player in players.values())), players


def opponents_in(players: Players, task: Task, role: Role) -> tuple[AbstractPolicy, ...]:
    """Return the opponents of a learner in a task."""
    return tuple(players[name, role.other].policy for name in task.opponents)
