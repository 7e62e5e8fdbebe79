"""Checks that a policy and its observation can be played, evaluated, shielded and exported."""

from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from apollonius.agents.policy import AbstractPolicy
from apollonius.arenas.charting import with_chart
from apollonius.arenas.file import as_game
from apollonius.conformance.defects import require_all, require_pure, require_rows
from apollonius.export.parity import Cases, cases_of, compare_decisions
from apollonius.export.player import Player, find_exportable, knowledge_and_memory
from apollonius.game.arena import Arena
from apollonius.game.dynamics import is_continuous
from apollonius.game.game import Game, reset_batch
from apollonius.game.types import NUM_ACTIONS, RobotState, Role
from apollonius.io.errors import require
from apollonius.observe.observation import AbstractObservation
from apollonius.observe.view import look, view_of
from jaxpr2c.compiler import CompiledProgram, has_compiler
from jaxpr2c.translator import translate

_CASES = 200
"""States of games against a random opponent, in which a policy is asked."""
_ROUNDING = 1e-3
_NEAR = 0.1
"""Tolerance between the observation of a mirror image and the mirrored observation: the cells of a
chart are not symmetric.
"""


def check_policy(policy: AbstractPolicy | str, role: Role, game: Game | str = "paper") -> None:
    """Check that a policy, or the player of a name, can be played, evaluated, shielded and
    exported.

    It must answer one view by an action of one shape and a memory of one shape, be pure, compile,
    give the same in a batch as alone, and be the same in C; its observation must have the size and
    the mirror that it says.

    Args:
        policy: an instance, or a player's name.
        role: the side that it plays.
        game: a game in one arena, or its name.

    Raises:
        apollonius.conformance.defects.Nonconformance: with a line for each property that it lacks.
        InvalidInput: for a game, a side or a player that cannot be.
    """
    player = find_exportable(policy, role, as_game(game))
    checks = _Checks(player)
    require_all(
        player.name, {"observation": checks.observation, "action and memory": checks.answer}
    )
    require_all(player.name, {"purity": checks.purity})
    cases = cases_of(player, _CASES)
    require_all(
        player.name,
        {
            "batches and actions": lambda: checks.actions(cases),
            "choice": lambda: checks.choice(cases),
            "mirror": checks.mirror,
            "export": lambda: checks.export(cases),
        },
    )


class _Checks:
    """The properties of a player, each a method that raises InvalidInput where it does not hold."""

    def __init__(self, player: Player) -> None:
        self.player = player
        self.policy = player.package
        self.game = player.game
        self.example = player.arguments[2:]

    def see(
        self, state: Array, active: Array | None, movers: Array | None, memory: Any
    ) -> tuple[Any, Any]:
        """Return the policy's observation and its memory."""
        sides = self.game.bodies.map(len)
        knowledge, _, _, own = knowledge_and_memory(
            self.game, self.player.role, sides, state, active, movers, memory
        )
        return self.policy.observation(view_of(self.game, knowledge, self.player.role)), own

    def ask(self, *case: Any) -> tuple[Any, Any]:
        """Return the policy's action and its next memory in one of `Cases`."""
        *inputs, bits = case
        return self.policy(*self.see(*inputs), bits)

    def observation(self) -> None:
        reads = self.policy.observation
        if isinstance(reads, AbstractObservation):
            numbers = jax.eval_shape(lambda *example: self.see(*example)[0], *self.example[:-1])
            shape = _type_and_shape(numbers)
            require(
                shape == f"float32 [{reads.size}]",
                "its result",
                shape,
                f"float32 [{reads.size}], as its size is",
            )

    def answer(self) -> None:
        action, memory = jax.eval_shape(self.ask, *self.example)
        expected = "float32 [2]" if self.policy.continuous else "int32 []"
        require(
            _type_and_shape(action) == expected,
            "action",
            _type_and_shape(action),
            f"{expected}, as continuous is",
        )
        form = jax.tree.map(_type_and_shape, jax.eval_shape(lambda: self.policy.memory))
        bound = f"{form}, as the first memory is, in every step"
        require(
            jax.tree.map(_type_and_shape, memory) == form,
            "next memory",
            jax.tree.map(_type_and_shape, memory),
            bound,
        )

    def purity(self) -> None:
        require_pure(self.ask, *self.example)

    def actions(self, cases: Cases) -> None:
        action, _ = require_rows(
            self.ask, tuple(jax.tree.map(jnp.asarray, tuple(cases))), _ROUNDING
        )
        low, high = (-1, 1) if is_continuous(action) else (0, NUM_ACTIONS - 1)
        values = np.asarray(action)
        outside = values[~((values >= low) & (values <= high))]
        require(not outside.size, "action", outside[:1], f"from {low} to {high}; clip it")

    def choice(self, cases: Cases) -> None:
        @jax.jit
        def choices(*case: Any) -> Array:
            *inputs, bits = case
            scores, _ = self.policy.score(*self.see(*inputs), bits)
            return jax.vmap(lambda allowed: self.policy.select(scores, allowed))(
                jnp.eye(NUM_ACTIONS, dtype=bool)
            )

        chosen = choices(*jax.tree.map(jnp.asarray, tuple(cases.at(0))))
        is_allowed = np.array_equal(chosen, np.arange(NUM_ACTIONS))
        require(
            is_allowed,
            "select",
            np.asarray(chosen),
            "an allowed action, also where one is: a shield asks it",
        )

    def mirror(self) -> None:
        reads, role = self.policy.observation, self.player.role
        if not isinstance(reads, AbstractObservation) or reads.mirror is None:
            return
        require(
            sorted(reads.mirror.order) == list(range(reads.size)),
            "order",
            reads.mirror.order,
            "a permutation",
        )
        games = [self._plain(is_image) for is_image in (False, True)]
        states = reset_batch(games[0], jax.random.key(0), _CASES)
        images = jax.vmap(lambda state: replace(state, robots=state.robots.map(self._images)))(
            states
        )
        numbers, expected = (
            jax.jit(jax.vmap(lambda state, game=game: reads(look(game, state, role))))(some)
            for game, some in zip(games, (states, images), strict=True)
        )
        away = np.quantile(np.abs(reads.mirror(numbers) - expected), 0.9, axis=0)
        bound = "that of the mirror image: correct its place in order, or its sign"
        require(
            away.max() <= _NEAR,
            f"number {away.argmax()} of mirror",
            f"off by {away.max():.2g}",
            bound,
        )

    def _plain(self, is_image: bool) -> Game:
        """Return the game among its discs and polygons alone, or its mirror image from bottom to
        top.
        """
        arena, height = self.game.arena, self.game.arena.y_min + self.game.arena.y_max
        discs, polygons = arena.discs, arena.polygons
        if is_image:
            discs = tuple(replace(disc, y=height - disc.y) for disc in discs)
            corners = [
                tuple((x, height - y) for x, y in reversed(polygon.vertices))
                for polygon in polygons
            ]
            polygons = tuple(
                replace(polygon, vertices=vertices)
                for polygon, vertices in zip(polygons, corners, strict=True)
            )
        walls = Arena(arena.x_min, arena.x_max, arena.y_min, arena.y_max, discs, polygons)
        plain = replace(self.game.in_arena(walls), sensors=None, drives=None, movers=None)
        return with_chart(plain) if self.policy.needs_chart else plain

    def _images(self, robots: tuple[RobotState, ...]) -> tuple[RobotState, ...]:
        height = self.game.arena.y_min + self.game.arena.y_max
        return tuple(replace(robot, y=height - robot.y, heading=-robot.heading) for robot in robots)

    def export(self, cases: Cases) -> None:
        player = self.player
        program = translate(player.decide, *player.arguments, name="player")
        if has_compiler():
            compiled = CompiledProgram(program)

            def decide(*case: Any) -> tuple[np.ndarray, np.ndarray]:
                action, controls = compiled(player.policy, player.game, *case)[:2]
                return action, controls

            parity = compare_decisions(decide, player, cases)
            bound = "the same in C; report this as an error"
            require(
                not parity.errors,
                "decisions",
                f"others in {parity.errors} of {len(cases.states)} states",
                bound,
            )


def _type_and_shape(leaf: Any) -> str:
    """Return the type and the shape of an array, as `float32 [2]`."""
    leaf = jax.eval_shape(lambda: jnp.asarray(leaf)) if isinstance(leaf, int | float) else leaf
    return f"{leaf.dtype} {list(leaf.shape)}"
