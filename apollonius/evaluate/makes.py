"""Robots of other makes: the same two players with a faster, nimbler pursuer and larger bodies, a match for each."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from apollonius.agents.kind import Named
from apollonius.agents.policy import AbstractPolicy
from apollonius.catalogue import find_player
from apollonius.errors import InvalidInput, require
from apollonius.evaluate.match import Match, MatchResult, play_match
from apollonius.evaluate.shields import alike
from apollonius.evaluate.start_filter import StartFilter
from apollonius.game.by_side import BySide
from apollonius.game.game import Game
from apollonius.game.types import ROLES
from apollonius.playout import Report


@dataclass(frozen=True)
class Make:
    """How the pursuer's limits compare with the evader's, and how large both robots are.

    Attributes:
        speed_ratio: the pursuer's top speed over the evader's.
        turn_ratio: the pursuer's largest turn rate over the evader's.
        radius: of both bodies [m]; None where they differ, as they may in a game.
    """

    speed_ratio: float
    turn_ratio: float
    radius: float | None

    def __str__(self) -> str:
        radius = "" if self.radius is None else f", radius {self.radius:g} m"
        return f"speed ratio {self.speed_ratio:.3g}, turn ratio {self.turn_ratio:.3g}{radius}"

    def is_like(self, other: "Make") -> bool:
        """Whether the other one differs by rounding only."""
        if self.radius is None or other.radius is None:
            return False
        pairs = zip(asdict(self).values(), asdict(other).values(), strict=True)
        return all(math.isclose(one, another, abs_tol=1e-9) for one, another in pairs)


def make_of(game: Game) -> Make:
    """The make of a game's own robots.

    Raises:
        InvalidInput: for an evader that cannot turn, as nothing can be told in its turn rate.
    """
    game.require_two("a make")
    pursuer, evader = game.pursuer, game.evader
    bound = "more than 0 rad/s: the pursuer's turn rate is told as a ratio to it"
    require(evader.u2_max > 0, "evader.u2_max", evader.u2_max, bound)
    radius = float(pursuer.radius) if pursuer.radius == evader.radius else None
    return Make(float(pursuer.v_max / evader.v_max), float(pursuer.u2_max / evader.u2_max), radius)


def with_make(game: Game, make: Make) -> Game:
    """A game between robots of another make.

    The evader's limits stay, and the pursuer's acceleration and least speed. Lengths between centres grow with the
    bodies, so that the gaps between these stay: the one at which the evader is caught, and the least one at the start.

    Raises:
        InvalidInput: for robots that cannot be or find no place to start; names the make.
    """
    if make.is_like(make_of(game)):
        return game
    radii = float(game.pursuer.radius), float(game.evader.radius)
    radius = radii if make.radius is None else (make.radius, make.radius)
    grown = sum(radius) - sum(radii)
    least = (sum(radii) - game.capture_distance) / 2
    bound = f"more than {least:g} m, as the game's own bodies overlap by {2 * least:g} m before the evader is caught"
    require(game.capture_distance + grown > 0, "radius", make.radius, bound)
    pursuer = replace(
        game.pursuer,
        v_max=make.speed_ratio * game.evader.v_max,
        u2_max=make.turn_ratio * game.evader.u2_max,
        radius=radius[0],
    )
    try:
        return replace(
            game,
            pursuer=pursuer,
            evader=replace(game.evader, radius=radius[1]),
            capture_distance=game.capture_distance + grown,
            starts=replace(game.starts, separation=game.starts.separation + grown),
        )
    except InvalidInput as error:
        raise InvalidInput(f"{make}: {error}") from error


@dataclass(frozen=True)
class MakeTable:
    """How two players do with robots of every make.

    Attributes:
        pursuer, evader: what they are called.
        speed_ratios, turn_ratios, radii: those that were played, ascending.
        capture_distances: at which the evader is caught [m], one for each radius.
        matches: a match for each make, by radius, then by turn ratio, then by speed ratio.
        own: the make of the game's own robots.
        own_match: the match with these.
    """

    pursuer: str
    evader: str
    speed_ratios: tuple[float, ...]
    turn_ratios: tuple[float, ...]
    radii: tuple[float, ...]
    capture_distances: tuple[float, ...]
    matches: tuple[tuple[tuple[MatchResult, ...], ...], ...]
    own: Make
    own_match: MatchResult

    @property
    def win_rates(self) -> Float[np.ndarray, "radii turns speeds"]:
        """The pursuer's share of wins in each match."""
        return np.array([[[match.pursuer_win_rate for match in row] for row in part] for part in self.matches])

    def to_dict(self) -> dict[str, Any]:
        """The table as JSON-like data: the match with the game's own robots, then one for each make."""
        makes = [
            {"speed_ratio": speed, "turn_ratio": turn, "radius": radius, "capture_distance": caught} | match.to_dict()
            for radius, caught, part in zip(self.radii, self.capture_distances, self.matches, strict=True)
            for turn, row in zip(self.turn_ratios, part, strict=True)
            for speed, match in zip(self.speed_ratios, row, strict=True)
        ]
        return {"own": asdict(self.own) | self.own_match.to_dict(), "makes": makes}


def play_makes(
    game: Game,
    names: BySide[str],
    speed_ratios: Sequence[float],
    turn_ratios: Sequence[float],
    radii: Sequence[float],
    games: int,
    seed: int = 0,
    starts: StartFilter = StartFilter.ALL,
    report: Report = lambda done, total: None,
) -> MakeTable:
    """Play a match of two players with robots of every make, all with the same seed, and with the game's own.

    All numbers that differ are data: what is compiled for one make serves all.

    Args:
        game: the rules, and the robots that others are compared with.
        names: of the players, as `find_player` takes them.
        speed_ratios, turn_ratios, radii: of the makes, each with each; radii in m. Their order does not matter.
        games: in each match.
        seed, starts: as of a `Match`.
        report: told of the games of all matches together.

    Raises:
        InvalidInput: unless there is one of each number, for a make that no game can be played with, and as
            `find_player` and `play_match`; all but the last before anything is played.
    """
    axes = [tuple(sorted(set(map(float, values)))) for values in (speed_ratios, turn_ratios, radii)]
    for name, values in zip(("speed ratios", "turn ratios", "radii"), axes, strict=True):
        require(values, name, "none", "one at least")
    speeds, turns, sizes = axes
    own = make_of(game)
    ROLES.map(lambda role: find_player(names[role], role, game))  # whom there is not is refused without a make
    makes = [Make(speed, turn, radius) for radius in sizes for turn in turns for speed in speeds]
    played = makes if any(make.is_like(own) for make in makes) else [*makes, own]
    rules = [game if make is own else with_make(game, make) for make in played]
    found = [_players(one, names, make) for one, make in zip(rules, played, strict=True)]
    policies = ROLES.map(lambda role: alike([players[role].policy for players in found]))
    pairs = [BySide(*map(_playing, players, both)) for players, *both in zip(found, *policies, strict=True)]
    results, total = [], games * len(played)
    for one, players in zip(rules, pairs, strict=True):
        before = games * len(results)

        def of_all(done: int, _: int, before: int = before) -> None:
            report(before + done, total)

        results.append(play_match(Match(one, players, games, seed, starts), report=of_all))
    own_match = next(result for make, result in zip(played, results, strict=True) if make is own or make.is_like(own))
    ended = iter(results)
    matches = tuple(tuple(tuple(next(ended) for _ in speeds) for _ in turns) for _ in sizes)
    caught = tuple(float(one.capture_distance) for one in rules[: len(makes) : len(speeds) * len(turns)])
    called = pairs[0].map(lambda player: player.name)
    return MakeTable(called.pursuer, called.evader, speeds, turns, sizes, caught, matches, own, own_match)


def _players(game: Game, names: BySide[str], make: Make) -> BySide[Named]:
    """The players of one game; a refusal names its make."""
    try:
        return ROLES.map(lambda role: find_player(names[role], role, game))
    except InvalidInput as error:
        raise InvalidInput(f"{make}: {error}") from error


def _playing(player: Named, policy: AbstractPolicy) -> Named:
    return replace(player, policy=policy)
