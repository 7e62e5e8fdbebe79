"""Players that search and hide, by what they believe."""

import functools
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.arenas.charting import charted
from apollonius.arenas.file import find_game
from apollonius.catalogue import find_player
from apollonius.game.by_side import BySide
from apollonius.game.chart import COARSE
from apollonius.game.types import GameState, Role, Sight
from apollonius.io.errors import InvalidInput
from apollonius.observe.view import look
from tests.acting import robot

NO_BITS = jnp.zeros((), jnp.uint32)


@functools.cache
def game():
    return charted(find_game("one-large"))


def view(pursuer, evader, age=1e3, unseen=None):
    """What the pursuer sees that knows where the evader was some time ago, and for how long cells were not seen."""
    belief = jnp.full((COARSE, COARSE), -1.0) if unseen is None else jnp.asarray(unseen, jnp.float32)
    state = GameState.of_two(pursuer, evader, jnp.int32(0))
    return look(game(), replace(state, sight=Sight((jnp.float32(age),), belief)), Role.PURSUER)


@functools.cache
def decision(name):
    return jax.jit(find_player(name, Role.PURSUER, game()).policy)


def cells(*places):
    """Cells of which some were not seen for some seconds: x, y [m] and the time; no opponent can be in the others."""
    unseen = np.full((COARSE, COARSE), -1.0)
    for x, y, time in places:
        unseen[int(y * 4), int(x * 4)] = time
    return unseen


def number(x, y):
    return int(y * 4) * COARSE + int(x * 4)


def test_a_searcher_drives_to_a_place_until_the_opponent_cannot_be_there():
    here = robot(2.0, 2.0, 0.5, 0.0)
    ahead, behind = (8.1, 2.1), (2.1, 8.1)
    only_ahead = view(here, robot(5.0, 5.0), unseen=cells((*ahead, 50.0)))
    action, memory = decision("search")(only_ahead, jnp.int32(-1), NO_BITS)
    assert int(memory) == number(*ahead)
    assert int(action) // 3 == 2, "speeds up along its heading"
    both = view(here, robot(5.0, 5.0), unseen=cells((*ahead, 1.0), (*behind, 1e3)))
    for bits in range(20):  # it keeps its place, though another one is worth much more
        assert int(decision("search")(both, jnp.int32(number(*ahead)), jnp.uint32(bits))[1]) == number(*ahead)
    seen_empty = view(here, robot(5.0, 5.0), unseen=cells((*behind, 1e3)))
    action, memory = decision("search")(seen_empty, jnp.int32(number(*ahead)), NO_BITS)
    assert int(memory) == number(*behind)
    assert int(action) % 3 == 2, "turns to the left"
    reached = view(robot(*ahead), robot(5.0, 5.0), unseen=cells((*ahead, 1.0), (*behind, 1e3)))
    assert int(decision("search")(reached, jnp.int32(number(*ahead)), NO_BITS)[1]) == number(*behind)


def test_places_are_drawn_by_what_a_look_is_worth():
    """Of two, the one that is worth twice as much is drawn in three games of four: of uniform numbers u and v half of
    v is the larger one in every fourth."""
    near = view(robot(5.0, 1.0), robot(5.0, 9.0), unseen=cells((1.1, 1.1, 50.0), (8.9, 1.1, 25.0)))
    search = find_player("search", Role.PURSUER, game()).policy
    draw = jax.jit(jax.vmap(lambda bits: search.weigh(near, jnp.int32(-1), bits)[1]))
    drawn = np.asarray(draw(jnp.arange(1000, dtype=jnp.uint32)))
    assert set(drawn) == {number(1.1, 1.1), number(8.9, 1.1)}
    assert np.mean(drawn == number(1.1, 1.1)) == pytest.approx(0.75, abs=0.05)
    assert set(np.asarray(draw(jnp.arange(4, dtype=jnp.uint32)))) == set(drawn), "the bits decide"


def test_a_pursuer_that_searches_is_itself_while_it_sees_and_searches_then():
    here, there = robot(2.0, 2.0, 0.3, 1.0), robot(3.0, 8.0)
    unseen = cells((8.1, 2.1, 50.0))
    for age, same_as in ((0.0, "pure-pursuit"), (1.0, "pure-pursuit"), (1.1, "search"), (20.0, "search")):
        seen = view(here, there, age, unseen)
        bare, memory = find_player(same_as, Role.PURSUER, game()).policy, jnp.int32(-1)
        own = jax.jit(bare.weigh)(seen, memory if same_as == "search" else (), NO_BITS)[0]
        action, (_, place) = decision("searching:pure-pursuit")(seen, ((), memory), NO_BITS)
        assert int(action) == int(jnp.argmax(own))
        assert int(place) == (-1 if same_as == "pure-pursuit" else number(8.1, 2.1))


def test_a_searching_agent_of_a_game_without_sensors_is_that_agent():
    agent, searching = (find_player(name, Role.PURSUER, game()).policy for name in ("pursuer", "searching:pursuer"))

    @jax.jit
    @jax.vmap
    def acts(key):
        seen = look(game(), game().reset(key), Role.PURSUER)
        return agent(agent.observation(seen), (), NO_BITS)[0], searching(seen, searching.memory, NO_BITS)[0]

    own, while_searching = acts(jax.random.split(jax.random.key(0), 20))
    np.testing.assert_array_equal(own, while_searching)
    assert len(set(np.asarray(own))) > 1


@pytest.mark.parametrize(
    ("name", "role", "words"),
    [
        ("searching:P_smooth", Role.PURSUER, "nine actions"),
        ("searching:flee", Role.EVADER, "the pursuer only"),
        ("searching:P_none", Role.PURSUER, "P_none"),
    ],
)
def test_those_who_cannot_search_are_refused(name, role, words):
    with pytest.raises(InvalidInput, match=words):
        find_player(name, role, game())


def test_a_hider_leaves_the_pursuers_sight():
    """From beside the disc it drives behind it, and not towards a pursuer that waits there."""
    hide = find_player("hide", Role.EVADER, game()).policy
    act = jax.jit(lambda state: hide(look(game(), state, Role.EVADER), (), NO_BITS)[0])
    pursuer, evader = robot(1.5, 5.0), robot(7.0, 6.8, 0.5, -np.pi / 2)
    state, step = (
        GameState.of_two(pursuer, evader, jnp.int32(0)),
        jax.jit(lambda state, *actions: game().step(state, *actions)),
    )
    assert not bool(game().arena.hides(state.pursuer, state.evader))
    for _ in range(60):
        state = step(state, [jnp.int32(1)], [act(state)]).state
        state = replace(state, robots=BySide((pursuer,), state.robots.evader))
    assert bool(game().arena.hides(state.pursuer, state.evader))
    assert float(jnp.hypot(state.evader.x - 7.0, state.evader.y - 6.8)) > 0.5
