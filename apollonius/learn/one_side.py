"""Stages in which one side learns, in one or several games, against opponents that do not."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Generic, Literal, TypeVar

import equinox as eqx

from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.pool import Pool, single_player
from apollonius.agents.source import NamedPlayer
from apollonius.arenas.charting import with_chart
from apollonius.catalogue import TABLE, find_player
from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.io.errors import require, require_within
from apollonius.learn.algorithm import Algorithm
from apollonius.learn.stage import Metrics, Stage, StageConfig, TrainState
from apollonius.observe.registry import find_observation

Players = dict[tuple[str, Role], NamedPlayer]
"""Players by name and side."""
LineUp = tuple[Game, dict[Role, tuple[str, ...]]]
"""A game, and the names of its players by side."""


@dataclass(frozen=True)
class OneSideConfig(StageConfig):
    """A stage in which one side learns, against opponents that do not."""

    is_judged = False
    evaluations: int = 10
    evaluation_games: int = 300
    role: Literal["pursuer", "evader"] = "evader"
    """The side that learns."""
    opponents: tuple[str, ...] = ("pursuer",)
    """Its opponents, each in an equal part of the games."""
    clearance_margin: float = 0.0
    """Clearance [m] that an action should leave after braking
    (`apollonius.agents.wrappers.clearance_penalty`); 0 for none.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        require(len(self.opponents) >= 1, "opponents", "none", "one at least")
        require_within(self, 0, 10**9, "clearance_margin")

    @property
    def side(self) -> Role:
        """The side that learns."""
        return Role[self.role.upper()]

    @property
    def roles(self) -> tuple[Role, ...]:
        return (self.side,)

    @property
    def opponent_names(self) -> tuple[str, ...]:
        return self.opponents[:1]

    def line_ups(self, game: Game) -> list[LineUp]:
        """List the games that a run in this game is trained in, each with the names of its players
        by side.
        """
        return [(game, {self.side.other: self.opponents})]

    def require_players(self, game: Game) -> None:
        """Refuse, by InvalidInput, opponents and a teacher that cannot be found."""
        for game_of_task, names in self.line_ups(game):
            _find(game_of_task, names)

    def check(self, algorithm: Algorithm, game: Game) -> None:
        """Refuse a clearance margin for a network whose observation does not have the room to
        brake, too.
        """
        super().check(algorithm, game)
        bound = "egocentric or team, which know the room to brake, or no clearance_margin"
        knows_room = find_observation(algorithm.observation).needs_chart
        has_none = self.clearance_margin == 0
        require(has_none or knows_room, "observation", algorithm.observation, bound)


class TrainingTask(eqx.Module):
    """A game, and the learner's opponents in it, each in an equal part of the games."""

    game: Game
    opponents: tuple[AbstractPolicy, ...]


T = TypeVar("T", bound=TrainingTask)
S = TypeVar("S", bound=TrainState)


class OneSideStage(Stage, Generic[T]):
    """A stage whose tasks take turns, chunk by chunk, each with games of its own."""

    tasks: eqx.AbstractVar[tuple[T, ...]]

    @abstractmethod
    def train_task(self, state: Any, task: T) -> tuple[Any, Metrics]:
        """Train one chunk in one task, whose games are the state's. The state is consumed."""

    def step(self, state: S) -> tuple[S, Metrics]:
        chunk = int(state.iterations) // self.algorithm.iterations_per_chunk
        number = chunk % len(self.tasks)
        games = list(state.games)
        after, metrics = self.train_task(replace(state, games=games[number]), self.tasks[number])
        games[number] = after.games
        return replace(after, games=tuple(games)), metrics

    @property
    def opponents(self) -> Pool:
        """The first opponent in the first game."""
        return single_player(self.tasks[0].opponents[0])

    @property
    def clearance_margin(self) -> float:
        return self.config.clearance_margin


def equal_parts(games: int, kinds: int) -> list[int]:
    """Divide games between kinds of opponents: equally, with one more for each of the first if need
    be.
    """
    return [games // kinds + (number < games % kinds) for number in range(kinds)]


def resolve_players(game: Game, names: Mapping[Role, Sequence[str]]) -> tuple[Game, Players]:
    """Return a game, with charts where its players of these names read them, and these; `TABLE` is
    nobody here.
    """
    players = _find(game, names)
    return with_chart(game, any(player.policy.needs_chart for player in players.values())), players


def _find(game: Game, names: Mapping[Role, Sequence[str]]) -> Players:
    requested = {(name, role) for role in names for name in names[role] if name != TABLE}
    return {each: find_player(*each, game) for each in requested}
