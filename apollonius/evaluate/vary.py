"""A sweep over numbers of a game: a match for each value, all with one seed; numbers are data to the compiled code."""

import difflib
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.shield import Backup, Shielded
from apollonius.evaluate.match import Match, MatchResult, play_match, play_matches
from apollonius.game.game import Game
from apollonius.game.types import ROLES, BySide
from apollonius.io.arrays import named_leaves
from apollonius.io.errors import InvalidInput, require
from apollonius.play.playout import Report, silent


@dataclass(frozen=True)
class Variation:
    """A number of a game, by its dotted path as `arena.discs.0.radius`, and its values in their order."""

    field: str
    values: tuple[float, ...]


@dataclass(frozen=True)
class VariedMatches:
    """Results of two players' matches over the values of one number of a game or two; `match` is the first one."""

    match: Match
    variations: tuple[Variation, ...]
    results: tuple[MatchResult, ...]

    @property
    def win_rates(self) -> Float[np.ndarray, "..."]:
        """The pursuer's share of wins, an axis for each varied number."""
        rates = np.array([result.pursuer_win_rate for result in self.results])
        return rates.reshape([len(one.values) for one in self.variations])

    def to_dict(self) -> dict[str, Any]:
        """Return the results as JSON-like data, each beside the values that it is of."""
        fields = [one.field for one in self.variations]
        values = itertools.product(*(one.values for one in self.variations))
        rows = zip(values, self.results, strict=True)
        return {"vary": fields, "matches": [dict(zip(fields, at, strict=True)) | found.to_dict() for at, found in rows]}


def numbers_of(game: Game) -> dict[str, float]:
    """Return the numbers of a game that can be varied, by their dotted paths."""
    return {name: leaf for name, leaf in _leaves(game).items() if isinstance(leaf, int | float)}


def with_numbers(game: Game, numbers: dict[str, float]) -> Game:
    """Return a game with other numbers at some dotted paths; raises InvalidInput for impossible paths and values."""
    known = numbers_of(game)
    for field in numbers:
        if field not in known:
            near = difflib.get_close_matches(field, known, n=1, cutoff=0.0)[0]
            raise InvalidInput(f"the game has no number '{field}'; did you mean '{near}'?")

    leaves = _leaves(game)
    for name, number in numbers.items():
        leaves[name] = int(number) if isinstance(leaves[name], int) and number.is_integer() else number
    varied = jax.tree.unflatten(jax.tree.structure(game), leaves.values())
    try:
        varied.check()
    except InvalidInput as error:
        at = ", ".join(f"{name} = {number:g}" for name, number in numbers.items())
        raise InvalidInput(f"with {at}: {error}") from error
    return varied


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
    """Return a match of two players for each value of a number of the game, or each pair of values of two numbers;
    errors as of `with_numbers` and `Match.of_names`.
    """
    fields = [one.field for one in variations]
    require(1 <= len(set(fields)) == len(fields) <= 2, "varied numbers", ", ".join(fields), "one or two different ones")
    grid = itertools.product(*(one.values for one in variations))
    rules = [with_numbers(game, dict(zip(fields, values, strict=True))) for values in grid]
    return [Match.of_names(one, names.pursuer, names.evader, games, seed, starts) for one in rules]


def play_varied(
    matches: Sequence[Match],
    variations: Sequence[Variation],
    report: Report = silent,
    play: Callable[..., MatchResult] = play_match,
) -> VariedMatches:
    """Play `varied_matches`; arguments and errors are those of `play_matches`."""
    policies = zip(*ROLES.map(lambda role: alike([match.players[role].policy for match in matches])), strict=True)
    matches = [
        replace(match, players=BySide(*map(lambda one, policy: replace(one, policy=policy), match.players, both)))
        for match, both in zip(matches, policies, strict=True)
    ]
    results = play_matches(matches, report=report, play=play)
    return VariedMatches(matches[0], tuple(variations), tuple(results))


def alike(policies: Sequence[AbstractPolicy]) -> list[AbstractPolicy]:
    """Return players of one side whose shields all brake for as many steps and look at as many edges as any shield.

    No shield decides otherwise: a robot that has come to rest stays there, and the edges that are added are far from
    everywhere. Players without a shield are left as they are.
    """
    backups = [policy.backup for policy in policies if isinstance(policy, Shielded)]
    if not backups:
        return list(policies)
    steps = max(backup.steps for backup in backups)
    edges = max(one.within.shape[-1] if (one := backup.surroundings) else 0 for backup in backups)
    return [
        replace(policy, backup=_enlarged(policy.backup, steps, edges)) if isinstance(policy, Shielded) else policy
        for policy in policies
    ]


def _enlarged(backup: Backup, steps: int, edges: int) -> Backup:
    """Return manoeuvres of a number of steps; the surroundings' last edge, far from everywhere, fills up each cell."""
    if (around := backup.surroundings) is None:
        return replace(backup, steps=steps)
    missing, far = edges - around.within.shape[-1], around.edges.x.shape[0] - 1
    within = jnp.pad(around.within, ((0, 0), (0, 0), (0, missing)), constant_values=far)
    return replace(backup, steps=steps, surroundings=replace(around, within=within))
