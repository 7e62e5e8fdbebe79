"""The named games, and games made from others: of teams, in several arenas."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import jax
import jax.numpy as jnp

from apollonius.game.arena import Arena, Disc
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.names import TEAM
from apollonius.game.reward import Reward
from apollonius.game.scenario import RobotKinds, Scenario, Spread
from apollonius.game.sensing import Noise, Sensing, Sensors
from apollonius.game.teams import Teams
from apollonius.io.errors import InvalidInput, closest_names, require, unknown_name
from apollonius.io.limits import ROBOTS


def paper() -> Game:
    """Table I, with three discs of radius 0.5 m (the paper draws obstacles but lists none)."""
    return Game(arena=Arena(discs=(Disc(3.0, 3.0, 0.5), Disc(7.0, 4.0, 0.5), Disc(5.0, 7.5, 0.5))))


def four_small() -> Game:
    """The `paper` game with four discs of radius 0.3 m."""
    centres = ((2.5, 2.5), (7.5, 2.5), (2.5, 7.5), (7.5, 7.5))
    return Game(arena=Arena(discs=tuple(Disc(x, y, 0.3) for x, y in centres)))


def one_large() -> Game:
    """The `paper` game with one disc of radius 1 m in the middle."""
    return Game(arena=Arena(discs=(Disc(5.0, 5.0, 1.0),)))


def zero_sum() -> Game:
    """The `paper` game paid +1 / -1 by outcome; outliving the time limit is the evader's win."""
    return Game(arena=paper().arena, reward=Reward(profile="zero-sum"))


def robot() -> Game:
    """The `paper` game of robots of radius 0.2 m, caught where their bodies are 0.1 m apart."""
    body = Unicycle(radius=0.2)
    return Game(pursuer=body, evader=body, arena=paper().arena, capture_distance=0.5)


def territory() -> Game:
    """The `paper` game with a territory, a disc of radius 1 m, that the evader would reach.

    Only captures, crashes and the territory are paid for. A territory that is not reached in time
    is a draw.
    """
    return Game(
        arena=Arena(discs=paper().arena.discs, territory=Disc(5.0, 5.0, 1.0)),
        reward=Reward(progress=0.0),
    )


def lidar() -> Game:
    """The `paper` game of robots with a lidar: 5 m far, not through obstacles, 5 cm, 0.1 s late."""
    sensors = Sensors(line_of_sight=True, range=5.0, noise=Noise(position=0.05), delay=1)
    return replace(paper(), sensors=Sensing(sensors, sensors))


def blind() -> Game:
    """The `paper` game of a pursuer that sees nothing."""
    return replace(paper(), sensors=Sensing(pursuer=Sensors(range=0.0)))


PRESETS: dict[str, Callable[[], Game]] = {
    make.__name__.replace("_", "-"): make
    for make in (paper, four_small, one_large, zero_sum, robot, territory, lidar, blind)
}


def make_game(name: str) -> Game:
    """Return the game of a name: a preset, or as `team-3v1`; raises InvalidInput for an unknown
    one.
    """
    team = TEAM.fullmatch(name)
    if team:
        return in_teams(paper(), int(team[1]), int(team[2]))
    if name not in PRESETS:
        choices = f"choose one of {', '.join(PRESETS)}, or as team-3v1"
        raise InvalidInput(
            unknown_name("game", str(name), choices, closest_names(str(name), PRESETS))
        )
    return PRESETS[name]()


def in_teams(game: Game, pursuers: int, evaders: int, mates_collide: bool = False) -> Game:
    """Return a game of two with more robots, all of a side with the limits of its one robot.

    Args:
        game: a game of two robots.
        pursuers, evaders: numbers of robots, 1 at least.
        mates_collide: whether mates that touch are out of play.

    Raises:
        InvalidInput: for a side with none or too many, for a game of teams, and as `Game`.
    """
    require(game.teams is None, "robots", game.size, "1 v 1, to be made a game of teams")
    for side, count in (("pursuers", pursuers), ("evaders", evaders)):
        ROBOTS.require(side, count)
    if pursuers == evaders == 1:
        return game
    mates = (game.pursuer,) * (pursuers - 1), (game.evader,) * (evaders - 1)
    return replace(game, teams=Teams(*mates, mates_collide))


def in_arenas(game: Game, arenas: Sequence[Arena]) -> Game:
    """Return a game in one of several arenas, drawn at each start; with one it is the game in that.

    All numbers of an arena are data, so one compilation serves all. `game.arena` is the first one.
    Raises InvalidInput for no arena, for one that the game cannot be played in, and where only some
    have a territory.
    """
    require(arenas, "arenas", "none", "one at least")
    first, *rest = map(game.in_arena, arenas)
    if not rest:
        return first
    return replace(first, scenario=Scenario.of(arenas))


_KINDS = 64
"""Kinds of robots that are drawn."""


def randomised(game: Game, spreads: Sequence[Spread]) -> Game:
    """Return a game in which each start draws these numbers of the robots, their sensors and drives
    (domain randomisation: Tobin et al., 2017; of dynamics Peng et al., 2018).

    Raises InvalidInput for a field that the robots do not have.
    """
    scenario = game.scenario
    if scenario is None:
        scenario = Scenario.of([game.arena])
    numbers = game.pursuer, game.evader, game.capture_distance
    kinds = scenario.kinds or RobotKinds(
        *jax.tree.map(lambda leaf: jnp.full(_KINDS, leaf, jnp.float32), numbers)
    )
    kinds = replace(
        kinds, sensors=kinds.sensors or game.sensors, drives=kinds.drives or game.drives
    )
    return replace(game, scenario=replace(scenario, kinds=kinds.spread(spreads)))
