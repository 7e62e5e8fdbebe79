"""What one robot sees, as it is: bodies, states and the arena, in metres, m/s and radians."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Int

from apollonius.game.arena import Arena
from apollonius.game.by_side import BySide
from apollonius.game.dynamics import Unicycle
from apollonius.game.fusion_barrier import fusion_barrier
from apollonius.game.game import Game
from apollonius.game.teams import Teams, nearest
from apollonius.game.types import GameState, Real, RobotState, Role, Scalar

T = TypeVar("T")


class Robot(eqx.Module):
    """A robot that is seen: its body's limits, its state, and whether it is in play."""

    body: Unicycle
    state: RobotState
    active: Bool[Array, ""] | bool = True


class View(eqx.Module):
    """What one robot sees. Nothing in it is scaled.

    Attributes:
        arena: walls and obstacles.
        own: the robot itself.
        mates: the other robots of its side.
        opponents: the robots of the other side.
        capture_distance: how near to each other they are when one is caught [m].
    """

    arena: Arena
    own: Robot
    mates: tuple[Robot, ...]
    opponents: tuple[Robot, ...]
    capture_distance: Real

    @property
    def opponent(self) -> Robot:
        """The opponent or, of several that are in play, the one whose centre is nearest."""
        states, active = ([getattr(one, name) for one in self.opponents] for name in ("state", "active"))
        return nearest(self.own.state, states, active, self.opponents)

    @property
    def robots(self) -> tuple[Robot, Robot]:
        """The robot and that opponent, the one that looks first."""
        return self.own, self.opponent


def look(game: Game, state: GameState, role: Role, number: int = 0) -> View:
    """What one robot sees in a state of the game.

    Args:
        role, number: its side, and which of its robots it is.
    """
    here = game.at(state)

    def robots(role: Role) -> tuple[Robot, ...]:
        both = zip(here.bodies[role], state.robots[role], state.active[role], strict=True)
        return tuple(Robot(*robot) for robot in both)

    ours = robots(role)
    mates = ours[:number] + ours[number + 1 :]
    return View(here.arena, ours[number], mates, robots(role.other), here.capture_distance)


class Views(eqx.Module):
    """What one side sees in many games at once. What the games have in common is there once.

    Of a team it is what every one of its robots sees, a row for each in each game: those of the first robot in all
    games come first, then those of the second.

    Attributes:
        game: the rules.
        states: of the games, leaves `[rows]`.
        role: the side.
        numbers: which of the side's robots looks, which is the first one in `states`; None where it has only one.
    """

    game: Game
    states: GameState
    role: Role = eqx.field(static=True)
    numbers: Int[Array, " rows"] | None = None

    @classmethod
    def of_all(cls, game: Game, states: GameState, role: Role) -> "Views":
        """What all robots of one side see in many games.

        Args:
            states: of the games, leaves `[games]`.
        """
        count, games = len(states.robots[role]), states.steps.shape[0]
        if count == 1:
            return cls(game, states, role)

        def first(number: int) -> GameState:
            def turned(values: BySide[tuple[T, ...]]) -> BySide[tuple[T, ...]]:
                ours = values[role]
                return BySide.of(role, ours[number:] + ours[:number], values[role.other])

            def of_one(state: GameState) -> GameState:
                return replace(state, robots=turned(state.robots), status=state.status and turned(state.status))

            return jax.vmap(of_one)(states)

        rows = _in_rows(*map(first, range(count)))
        return cls(game, rows, role, numbers=jnp.repeat(jnp.arange(count), games))

    def each(self, function: Callable[..., Any], *rest: Any) -> Any:
        """What a function makes of the view in each of the rows, and of the rest, leaves `[rows]`: its `vmap`."""

        def one(state: GameState, number: Int[Array, ""] | None, *rest: Any) -> Any:
            here = self.game if number is None else _turned(self.game.at(state), self.role, number)
            return function(look(here, state, self.role), *rest)

        return jax.vmap(one)(self.states, self.numbers, *rest)

    def part(self, rows: Int[Array, " some"]) -> "Views":
        """The views in some of the rows."""
        states, numbers = jax.tree.map(lambda leaf: leaf[rows], (self.states, self.numbers))
        return Views(self.game, states, self.role, numbers)


@fusion_barrier
def _in_rows(*states: GameState) -> GameState:
    """The states of one batch after those of another; what is made of a row is then made of many at a time."""
    return jax.tree.map(lambda *leaves: jnp.concatenate(leaves), *states)


def _turned(game: Game, role: Role, number: Int[Array, ""]) -> Game:
    """A game in one arena with the limits of one side's robots in another order: those of this number come first."""
    bodies = game.bodies[role]

    def at(place: int) -> Unicycle:
        def pick(*leaves: Real) -> Scalar:
            turns = [(number + place) % len(bodies) == other for other in range(len(bodies))]
            return jnp.select(turns, [jnp.asarray(leaf, jnp.float32) for leaf in leaves])

        return jax.tree.map(pick, *bodies)

    first, *others = map(at, range(len(bodies)))
    name = role.name.lower()
    teams = replace(game.teams or Teams(), **{f"{name}s": tuple(others)})
    return replace(game, **{name: first}, teams=teams)


def each(function: Callable[..., Any], seen: Any, *rest: Any) -> Any:
    """The same of what is seen in each of many games, be it views or arrays."""
    return seen.each(function, *rest) if isinstance(seen, Views) else jax.vmap(function)(seen, *rest)
