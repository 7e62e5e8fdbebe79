"""A sweep over numbers of a game: a match for each value, all with one seed; numbers are data to
the compiled code.
"""

import difflib
import itertools
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.wrappers.backup import Backup
from apollonius.agents.wrappers.shield import Shielded
from apollonius.evaluate.match import Match, MatchResult, play_match, play_matches
from apollonius.game.game import Game
from apollonius.game.types import ROLES, BySide
from apollonius.io.arrays import named_leaves
from apollonius.io.errors import InvalidInput, require
from apollonius.play.playout import Report, no_report


@dataclass(frozen=True)
class Variation:
    """A number of a game, by its dotted path as `arena.discs.0.radius`, and its values in their
    order.
    """

    field: str
    values: tuple[float, ...]


@dataclass(frozen=True)
class VariedMatches:
    """Results of two players' matches over the values of one number of a game or two; `match` is
    the first one.
    """

    match: Match
    variations: tuple[Variation, ...]
    results: tuple[MatchResult, ...]

    @property
    def win_rates(self) -> Float[np.ndarray, "..."]:
        """The pursuer's share of wins, an axis for each varied number."""
        rates = np.array([result.pursuer_win_rate for result in self.results])
        return rates.reshape([len(variation.values) for variation in self.variations])

    def to_dict(self) -> dict[str, Any]:
        """Return the results as JSON-like data, each beside the values that it is of."""
        fields = [variation.field for variation in self.variations]
        values = itertools.product(*(variation.values for variation in self.variations))

        matches = [
            dict(zip(fields, numbers, strict=True)) | result.to_dict()
            for numbers, result in zip(values, self.results, strict=True)
        ]
        return {"vary": fields, "matches": matches}


def variable_numbers(game: Game) -> dict[str, float]:
    """Return the numbers of a game that can be varied, by their dotted paths."""
    return {name: leaf for name, leaf in _leaves(game).items() if isinstance(leaf, int | float)}


def with_numbers(game: Game, numbers: dict[str, float]) -> Game:
    """Return a game with other numbers at some dotted paths, those of a side's first robot also at
    its mates that are like it; raises InvalidInput for impossible paths and values.
    """
    numbers_by_path = variable_numbers(game)
    for field in numbers:
        if field not in numbers_by_path:
            near = difflib.get_close_matches(field, numbers_by_path, n=1, cutoff=0.0)[0]
            raise InvalidInput(f"the game has no number '{field}'; did you mean '{near}'?")

    leaves = _leaves(game)
    of_mates = {mate: numbers[name] for name in numbers for mate in _like_mates(name, leaves)}
    for name, number in (of_mates | numbers).items():
        is_count = isinstance(leaves[name], int) and number.is_integer()
        leaves[name] = int(number) if is_count else number
    varied = jax.tree.unflatten(jax.tree.structure(game), leaves.values())
    try:
        varied.check()
    except InvalidInput as error:
        assignments = ", ".join(f"{name} = {number:g}" for name, number in numbers.items())
        raise InvalidInput(f"with {assignments}: {error}") from error
    return varied


def _like_mates(name: str, leaves: dict[str, Any]) -> list[str]:
    """Return the paths of a number of a side's first robot at those of its mates that have the
    same.
    """
    side, _, limit = name.partition(".")
    mates = re.compile(rf"teams\.{side}s\.\d+\.{re.escape(limit)}")
    return [path for path in leaves if mates.fullmatch(path) and leaves[path] == leaves[name]]


def _leaves(game: Game) -> dict[str, Any]:
    return {name.replace("/", "."): leaf for name, leaf in named_leaves(game).items()}


def varied_matches(
    game: Game,
    names: BySide[str],
    variations: Sequence[Variation],
    games: int,
    seed: int = 0,
    starts: str | None = None,
) -> list[Match]:
    """Make a match of two players for each value of a number of the game, or each pair of values of
    two numbers.

    Args:
        game: The game.
        names: Names or files of the two players.
        variations: The one or two numbers that are varied.
        games: Number of games of each match.
        seed: Seed of every match.
        starts: Initial speeds, `rest` or `moving`; the game's own for None.

    Raises:
        InvalidInput: As `with_numbers` and `Match.of_names`.
    """
    fields = [variation.field for variation in variations]
    is_possible = 1 <= len(set(fields)) == len(fields) <= 2
    require(is_possible, "varied numbers", ", ".join(fields), "one or two different ones")
    grid = itertools.product(*(variation.values for variation in variations))
    varied = [with_numbers(game, dict(zip(fields, values, strict=True))) for values in grid]
    pair = (names.pursuer, names.evader)
    return [Match.of_names(rules, *pair, games, seed, starts) for rules in varied]


def play_varied(
    matches: Sequence[Match],
    variations: Sequence[Variation],
    report: Report = no_report,
    play: Callable[..., MatchResult] = play_match,
) -> VariedMatches:
    """Play `varied_matches`.

    Args:
        matches: The matches, in the order of the values.
        variations: The numbers that are varied.
        report: Called with the games so far and in all.
        play: Function that plays one match.

    Raises:
        InvalidInput: As `play_matches`.
    """
    policies = ROLES.map(
        lambda role: pad_shields([match.players[role].policy for match in matches])
    )

    def with_policies(match: Match, pursuer: AbstractPolicy, evader: AbstractPolicy) -> Match:
        players = BySide(
            replace(match.players.pursuer, policy=pursuer),
            replace(match.players.evader, policy=evader),
        )
        return replace(match, players=players)

    matches = [*map(with_policies, matches, policies.pursuer, policies.evader)]
    results = play_matches(matches, report=report, play=play)
    return VariedMatches(matches[0], tuple(variations), tuple(results))


def pad_shields(policies: Sequence[AbstractPolicy]) -> list[AbstractPolicy]:
    """Return players of one side whose shields have arrays of one size: the most steps and edges of
    any shield.

    Their decisions stay the same: a robot that has come to rest stays there, and the added edges
    are far from everywhere. Players without a shield are not changed.
    """
    backups = [policy.backup for policy in policies if isinstance(policy, Shielded)]
    if not backups:
        return list(policies)
    steps = max(backup.steps for backup in backups)
    lists = [backup.surroundings.index for backup in backups if backup.surroundings]
    edges = max((index.within.shape[-1] for index in lists), default=0)

    def enlarge(policy: AbstractPolicy) -> AbstractPolicy:
        if not isinstance(policy, Shielded):
            return policy
        return replace(policy, backup=_enlarge(policy.backup, steps, edges))

    return [enlarge(policy) for policy in policies]


def _enlarge(backup: Backup, steps: int, edges: int) -> Backup:
    """Return a backup of a number of steps; the surroundings' last edge, far from everywhere, fills
    up each cell.
    """
    surroundings = backup.surroundings
    if surroundings is None:
        return replace(backup, steps=steps)
    index, far_edge = surroundings.index, len(surroundings.edges.x) - 1
    padding = [(0, 0)] * 3 + [(0, edges - index.within.shape[-1])]
    wider = replace(index, within=jnp.pad(index.within, padding, constant_values=far_edge))
    return replace(backup, steps=steps, surroundings=replace(surroundings, index=wider))
