"""One value for each side: by role, by both at once, and where only two robots will do."""

import jax
import jax.numpy as jnp
import pytest

from apollonius.game.by_side import BySide, one_each
from apollonius.game.presets import make_game
from apollonius.game.types import Role
from apollonius.io.errors import InvalidInput


def test_values_are_indexed_by_role_and_mapped():
    values = BySide(3, "a")
    assert (values[Role.PURSUER], values[Role.EVADER]) == (3, "a") == tuple(values)
    assert values.map(str) == BySide("3", "a")
    assert [BySide.of(role, role, role.other).pair for role in Role] == [(Role.PURSUER, Role.EVADER)] * 2


def test_both_values_are_leaves_the_pursuers_first():
    more = jax.vmap(lambda values: values.map(lambda x: x + 1))(BySide(jnp.arange(2), jnp.zeros(2)))
    assert [leaf.tolist() for leaf in jax.tree.leaves(more)] == [[1, 2], [1, 1]]


def test_what_is_of_two_robots_only_refuses_more_in_one_line():
    assert one_each(BySide(("p",), ("e",))) == BySide("p", "e")
    game = make_game("team-2v1")
    state = game.reset(jax.random.key(0))
    for asked in (lambda: state.pursuer, lambda: game.body(Role.EVADER)):
        with pytest.raises(
            InvalidInput, match=r"^robots = 2 v 1 is not possible: it must be 1 v 1: .+ two robots only.$"
        ):
            asked()
