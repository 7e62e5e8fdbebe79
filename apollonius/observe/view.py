"""What one robot sees, as it is: bodies, states and the arena, in metres, m/s and radians."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
from jaxtyping import Array, Int

from apollonius.game.arena import Arena
from apollonius.game.by_side import BySide, one_each
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.types import Action, Actions, GameState, Real, RobotState, Role, Scalar


class Robot(eqx.Module):
    """A robot that is seen: its body's limits, and its state."""

    body: Unicycle
    state: RobotState


class View(eqx.Module):
    """What one robot sees. Nothing in it is scaled.

    Attributes:
        arena: walls and obstacles.
        own: the robot itself.
        mates: the other robots of its side.
        opponents: the robots of the other side.
        capture_distance: how near to each other they are when one is caught [m].
        announced: the opponent's controls (u1 [m/s^2], u2 [rad/s]) in the step to come, if the robot is told them.
    """

    arena: Arena
    own: Robot
    mates: tuple[Robot, ...]
    opponents: tuple[Robot, ...]
    capture_distance: Real
    announced: tuple[Scalar, Scalar] | None = None

    @property
    def opponent(self) -> Robot:
        """The opponent in a game of two robots; errors as those of `one_each`."""
        return one_each(BySide((self.own, *self.mates), self.opponents)).evader

    @property
    def robots(self) -> tuple[Robot, Robot]:
        """Both robots of a game of two, the one that looks first."""
        return self.own, self.opponent


def look(game: Game, state: GameState, role: Role, number: int = 0) -> View:
    """What one robot sees in a state of the game.

    Args:
        role, number: its side, and which of its robots it is.
    """

    here = game.at(state)

    def robots(role: Role) -> tuple[Robot, ...]:
        return tuple(Robot(*both) for both in zip(here.bodies[role], state.robots[role], strict=True))

    ours = robots(role)
    mates = ours[:number] + ours[number + 1 :]
    return View(here.arena, ours[number], mates, robots(role.other), here.capture_distance)


class Views(eqx.Module):
    """What one side sees in many games at once. What the games have in common is there once.

    Attributes:
        game: the rules.
        states: of the games, leaves `[games]`.
        role: the side.
        announced: the opponents' actions in the step to come, leaves `[games]`, if the side is told them.
    """

    game: Game
    states: GameState
    role: Role = eqx.field(static=True)
    announced: Actions | None = None

    def each(self, function: Callable[..., Any], *rest: Any) -> Any:
        """What a function makes of the view in each of the games, and of the rest, leaves `[games]`: its `vmap`."""

        def one(state: GameState, announced: Action | None, *rest: Any) -> Any:
            view = look(self.game, state, self.role)
            if announced is not None:
                view = replace(view, announced=view.opponent.body.controls(announced))
            return function(view, *rest)

        return jax.vmap(one)(self.states, self.announced, *rest)

    def part(self, games: Int[Array, " some"]) -> "Views":
        """The views in some of the games."""
        states, announced = jax.tree.map(lambda leaf: leaf[games], (self.states, self.announced))
        return Views(self.game, states, self.role, announced)


def each(function: Callable[..., Any], seen: Any, *rest: Any) -> Any:
    """The same of what is seen in each of many games, be it views or arrays."""
    return seen.each(function, *rest) if isinstance(seen, Views) else jax.vmap(function)(seen, *rest)
