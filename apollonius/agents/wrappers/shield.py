"""A player that does not crash: another's actions, unless they leave no way to stop in time."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from apollonius.agents.policy import AbstractPolicy, AbstractWrapper, Memory
from apollonius.agents.wrappers.backup import MARGIN, Backup, brakes
from apollonius.game.dynamics import action_levels
from apollonius.game.game import Game
from apollonius.game.types import NUM_ACTIONS, Action, Flag, RandomBits, Role
from apollonius.observe.view import View

_NO_MANOEUVRE = -1


class Shielded(AbstractWrapper[AbstractPolicy]):
    """Another player, held back from actions after which the robot could not brake to rest without
    touching anything.

    An action is allowed where, after it, one of the backup manoeuvres comes to rest with clearance
    to spare. The rest of that manoeuvre is then allowed in the next step, and so on; so from rest,
    or from any state from which one of the manoeuvres is free, the robot never fails. This is a
    safety filter with backup manoeuvres (Hobbs et al., "Runtime assurance for safety-critical
    systems", 2023): what it calls safe is a part of the viability kernel.

    A robot that is uncertain of itself keeps farther away by the largest distance between its true
    path and the one that it knows. What it knows in the next step may be worse by chance.
    Where no action is allowed then, it continues the manoeuvre that was safe.

    A player with continuous actions keeps its own where that is allowed, and otherwise has the
    allowed discrete action nearest to it.
    """

    backup: Backup

    @property
    def memory(self) -> Memory:
        """The memory of the player and, of a robot that is uncertain of itself, the last manoeuvre
        that was safe; `_NO_MANOEUVRE` before there is one.
        """
        if not self.backup.is_uncertain:
            return self.policy.memory
        return self.policy.memory, jnp.int32(_NO_MANOEUVRE)

    def __call__(self, view: View, memory: Memory, bits: RandomBits) -> tuple[Action, Memory]:
        own_memory, last_safe = memory if self.backup.is_uncertain else (memory, None)
        scores, own_memory = self.score_view(view, own_memory, bits)
        search = jax.lax.while_loop(
            lambda search: search.is_open,
            lambda search: self.try_next(view, scores, search),
            self.start_search(view, scores),
        )
        if last_safe is None:
            return search.action, own_memory
        action, manoeuvre = self.continue_unless_safe(view, search.action, last_safe)
        return action, (own_memory, manoeuvre)

    def continue_unless_safe(
        self, view: View, action: Action, last_safe: Int[Array, ""]
    ) -> tuple[Action, Int[Array, ""]]:
        """Return an action that is safe; otherwise that of the last safe manoeuvre, and without one
        the action itself. The second value is the manoeuvre that is safe now.

        Args:
            view: what the robot sees.
            action: the one that the search for an allowed one ended with.
            last_safe: the last safe manoeuvre; `_NO_MANOEUVRE` before the first.
        """
        backup = self.backup.for_view(view)
        clearances = backup.clearances_after(view.own, action)
        is_safe = jnp.max(clearances) > MARGIN
        braking = jnp.asarray(backup.manoeuvres, jnp.int32)[jnp.maximum(last_safe, 0)]
        braking_action = jnp.stack(action_levels(braking)) if self.policy.continuous else braking
        continues = ~is_safe & (last_safe != _NO_MANOEUVRE)
        safe = jnp.where(is_safe, jnp.argmax(clearances), last_safe).astype(jnp.int32)
        return jnp.where(continues, braking_action, action), safe

    def promises(self, view: View) -> Flag:
        """Check whether the robot certainly never fails from here on: whether some action leaves a
        safe stop.
        """
        backup = self.backup.for_view(view)
        actions = jnp.arange(NUM_ACTIONS)
        clearances = jax.vmap(backup.clearance_after, (None, 0))(view.own, actions)
        return jnp.max(clearances) > MARGIN

    def preferred_action(self, scores: Any) -> Action:
        """Return the action of the player behind the shield."""
        if self.policy.continuous:
            return scores
        return self.policy.select(scores, jnp.ones(NUM_ACTIONS, bool))

    def start_search(self, view: View, scores: Any) -> "_Search":
        """Start the search for an allowed action; it ends at once where the own one surely is."""
        action = self.preferred_action(scores)
        number = jnp.full((), NUM_ACTIONS, jnp.int32) if self.policy.continuous else action
        is_open = ~self.backup.for_view(view).can_stop_straight(view.own, action)
        return _Search(action, number, jnp.full(NUM_ACTIONS, jnp.inf), is_open)

    def try_next(self, view: View, scores: Any, search: "_Search") -> "_Search":
        """Try the search's action; unless it is allowed, the best untried one comes next."""
        clearance = self.backup.for_view(view).clearance_after(view.own, search.action)
        allowed = clearance > MARGIN
        clearances = jnp.where(
            jnp.arange(NUM_ACTIONS) == search.number, clearance, search.clearances
        )
        untried = jnp.isinf(clearances)
        some_untried = jnp.any(untried)
        number = jnp.where(
            some_untried, self.policy.select(scores, untried), jnp.argmax(clearances)
        ).astype(jnp.int32)
        action = jnp.stack(action_levels(number)) if self.policy.continuous else number
        return _Search(
            jnp.where(allowed, search.action, action), number, clearances, ~allowed & some_untried
        )


class _Search(eqx.Module):
    """A search for an allowed action.

    Attributes:
        action: the one to try next or, at the end, to take.
        number: its index; `NUM_ACTIONS` for a player's own continuous action.
        clearances: clearance that each of the nine actions leaves [m]; infinite until it is tried.
        is_open: whether an action is still to be tried.
    """

    action: Action
    number: Int[Array, ""]
    clearances: Float[Array, "9"]
    is_open: Flag


def with_shield(
    policy: AbstractPolicy, game: Game, role: Role, is_uncertain: bool = False
) -> Shielded:
    """Put a player behind a shield, which replaces actions after which it could not brake in time.

    Args:
        policy: the player.
        game: the rules.
        role: its side.
        is_uncertain: whether its robot is uncertain of itself, as it is where the game says so.

    Raises:
        InvalidInput: if a robot of the side cannot brake to rest.
    """
    return Shielded(policy, brakes(game, role, is_uncertain))
