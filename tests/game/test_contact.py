"""Contact in one of several arenas, where only robots near obstacles are looked at."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.arenas.suite import suite_arena, suite_names
from apollonius.game.game import Game
from apollonius.game.packed_arena import contact_bounds, pack
from apollonius.game.presets import in_arenas
from apollonius.game.scenario import Scenario
from apollonius.game.types import Role
from tests.acting import robot

ARENAS = [suite_arena("suite-v1", name) for name in suite_names("suite-v1", "train")[::40]]
MOVES = 4_000


@pytest.fixture(scope="module")
def moves():
    """Random moves, most shorter than 0.3 m, some across the arena; also from places beyond the walls."""
    rng = np.random.default_rng(0)
    before = rng.uniform(-1, 12, (MOVES, 2)).astype(np.float32)
    length = np.where(rng.random((MOVES, 1)) < 0.9, 0.1, 3.0)
    after = (before + length * rng.normal(size=(MOVES, 2))).astype(np.float32)
    states = [jax.vmap(lambda place: robot(*place))(jnp.asarray(places)) for places in (before, after)]
    return *states, jnp.asarray(rng.choice([0.0, 0.2, 0.5], MOVES), jnp.float32)


def test_contact_is_that_of_the_arena_alone(moves):
    scenario = Scenario.of(ARENAS)
    numbers = jnp.arange(MOVES) % len(ARENAS)
    together = jax.vmap(lambda number, *move: scenario.arena(number).hits_obstacle(*move))
    alone = [jax.jit(jax.vmap(arena.hits_obstacle))(*moves) for arena in ARENAS]
    expected = np.stack(alone)[numbers, np.arange(MOVES)]
    assert 200 < expected.sum() < MOVES - 200
    np.testing.assert_array_equal(jax.jit(together)(numbers, *moves), expected)
    nested = jax.vmap(together)(*jax.tree.map(lambda leaf: leaf.reshape(-1, 40), (numbers, *moves)))
    np.testing.assert_array_equal(nested.ravel(), expected)
    for index in (*np.flatnonzero(expected)[:2], *np.flatnonzero(~expected)[:2]):
        one = jax.tree.map(lambda leaf, index=index: leaf[index], (numbers, *moves))
        assert together(*jax.tree.map(lambda leaf: leaf[None], one)).item() == expected[index]
        assert scenario.arena(one[0]).hits_obstacle(*one[1:]).item() == expected[index]


@pytest.mark.parametrize("without", ["discs", "polygons"])
def test_clearance_lies_within_its_bounds(moves, without):
    """Within the walls they are less than two cells apart."""
    before = moves[0]
    arenas = [replace(arena, **{without: ()}) for arena in ARENAS]
    bounds = contact_bounds(arenas)
    has_shapes = [number for number, arena in enumerate(arenas) if arena.discs or arena.polygons]
    assert has_shapes
    for number in has_shapes:
        arena = arenas[number]
        far_walls = replace(arena, x_min=-1e3, x_max=1e3, y_min=-1e3, y_max=1e3)
        clearance = jax.vmap(far_walls.clearance)(before.x, before.y)
        least, most = jax.vmap(bounds.clearance_bounds, (None, 0, 0))(jnp.int32(number), before.x, before.y)
        assert ((least <= clearance) & (clearance <= most)).all()
        inside = (before.x > arena.x_min) & (before.x < arena.x_max)
        inside &= (before.y > arena.y_min) & (before.y < arena.y_max)
        assert (most - least)[inside].max() < 2 * bounds.cell[number]


def test_place_is_clear_as_in_the_arena_alone(moves):
    """Where it matters."""
    scenario, (before, _, distance) = Scenario.of(ARENAS), moves
    numbers = jnp.arange(MOVES) % len(ARENAS)
    alone = [jax.jit(jax.vmap(arena.is_clear))(before.x, before.y, distance) for arena in ARENAS]
    expected = np.stack(alone)[numbers, np.arange(MOVES)]
    assert 200 < expected.sum() < MOVES - 200
    matters = jnp.arange(MOVES) % 3 > 0
    together = jax.vmap(lambda number, *place: scenario.arena(number).is_clear(*place))
    np.testing.assert_array_equal(together(numbers, before.x, before.y, distance), expected)
    asked = jax.jit(together)(numbers, before.x, before.y, distance, matters)
    np.testing.assert_array_equal(asked[matters], expected[matters])


def test_starts_are_those_of_the_arena_alone():
    game = in_arenas(Game(), ARENAS)
    keys = jax.random.split(jax.random.key(3), 40)
    variants = jnp.arange(40) % len(ARENAS)
    together = jax.jit(jax.vmap(game.reset_at))(variants, keys)
    for number, arena in enumerate(ARENAS):
        own = variants == number
        alone = jax.jit(jax.vmap(game.in_arena(arena).reset))(keys[own])
        for role in Role:
            ours, theirs = (state.robots[role][0] for state in (together, alone))
            np.testing.assert_array_equal(ours.x[own], theirs.x)
            np.testing.assert_array_equal(ours.heading[own], theirs.heading)


def test_packed_arena_answers_as_the_arena_itself(moves):
    """A packed one has no lists, and numbers of one length for many arenas."""
    before, after, radius = moves
    packed = [pack(arena) for arena in ARENAS]
    assert sum(not arena.discs and not arena.polygons for arena in packed) == 5
    for arena, other in zip(ARENAS, packed, strict=True):
        for method, arguments in (
            ("clearance", (before.x, before.y)),
            ("clearance_along", (before, after)),
            ("hits_obstacle", (before, after, radius)),
            ("hides", (before, after)),
            ("is_clear", (before.x, before.y, radius)),
        ):
            answers = [jax.jit(jax.vmap(getattr(one, method)))(*arguments) for one in (arena, other)]
            np.testing.assert_array_equal(*answers, err_msg=method)


def test_arenas_share_a_program_unless_they_are_small_or_swept():
    shapes = {str(jax.tree.map(jnp.shape, pack(suite_arena("suite-v2", f"fences-0{number}")))) for number in range(8)}
    assert len(shapes) <= 2
    small = Game().arena
    assert pack(small) is small
    swept = replace(ARENAS[0], discs=tuple(replace(disc, x=jnp.float32(disc.x)) for disc in ARENAS[0].discs))
    assert swept.discs
    assert pack(swept) is swept
