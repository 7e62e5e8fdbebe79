"""Games in several arenas at once: each goes as it goes alone, and one arena is as before."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.arenas.record import to_dict
from apollonius.evaluate.result import count_by_arena
from apollonius.game.arena import Arena, Disc
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game, reset_batch
from apollonius.game.polygon import Polygon
from apollonius.game.presets import in_arenas
from apollonius.game.types import Outcome, Role
from apollonius.io.errors import InvalidInput
from apollonius.play.playout import Results
from apollonius.solve.motion import motion_of

AGILE = Unicycle(v_max=2.0, u1_max=4.0, u2_max=3.0)
NARROW = Arena(0.0, 4.0, 0.0, 4.0, discs=(Disc(2.0, 2.0, 0.4),))
TRIANGLE = Polygon(((2, 0.5), (4, 0.5), (3, 2)))
WIDE = Arena(-1.0, 5.0, 0.0, 4.0, discs=(Disc(1.0, 1.0, 0.3), Disc(3.0, 3.0, 0.3)), polygons=(TRIANGLE,))
GAME = Game(AGILE, AGILE, NARROW, max_steps=60)
BOTH = in_arenas(GAME, [NARROW, WIDE])
sample = jax.jit(reset_batch, static_argnames="games")


@jax.jit
def held(game, states):
    """Outcomes of 30 steps straight ahead."""
    ahead = jnp.int32(7)

    def step(state, _):
        after = game.step(state, ahead, ahead)
        return after.state, after.outcome

    return jax.vmap(lambda state: jax.lax.scan(step, state, length=30)[1])(states)


def test_games_in_two_arenas_go_as_each_goes_alone_from_starts_in_either():
    starts = sample(BOTH, jax.random.key(0), 400)
    place = np.asarray(starts.place)
    assert 0.4 < place.mean() < 0.6
    assert np.asarray(starts.pursuer.x)[place == 1].min() < -0.3  # only one arena reaches so far
    together, anywhere = np.asarray(held(BOTH, starts)), jax.vmap(lambda state: replace(state, place=None))(starts)
    for number, arena in enumerate((NARROW, WIDE)):
        here = place == number
        clearances = jax.vmap(arena.clearance)(starts.pursuer.x, starts.pursuer.y)[here]
        assert clearances.min() >= GAME.starts.clearance - 1e-5
        alone = np.asarray(held(replace(GAME, arena=BOTH.scenario.arena(jnp.int32(number))), anywhere))
        np.testing.assert_array_equal(together[here], alone[here])
        assert len(set(alone[here].ravel())) > 4


def test_one_arena_is_a_game_as_ever():
    assert in_arenas(GAME, [WIDE]) == replace(GAME, arena=WIDE)
    assert len(jax.tree.leaves(GAME.reset(jax.random.key(0)))) == 9


@pytest.mark.parametrize(
    ("act", "said"),
    [
        (lambda: motion_of(BOTH, Role.PURSUER, 1), r"^arenas = 2 is not possible: it must be one, which a table"),
        (lambda: to_dict(BOTH), "as no file holds it"),
        (lambda: in_arenas(GAME, []), "arenas = none"),
        (
            lambda: in_arenas(GAME, [NARROW, replace(WIDE, territory=Disc(0.0, 3.0, 0.3))]),
            "all with a territory or all without",
        ),
        (lambda: in_arenas(GAME, [NARROW, replace(NARROW, discs=(Disc(9.0, 2.0, 0.4),))]), r"arena.discs\[0\] centre"),
    ],
)
def test_arenas_that_do_not_go_together_or_must_be_one_are_refused(act, said):
    with pytest.raises(InvalidInput, match=said):
        act()


def test_arenas_in_which_nothing_was_played_are_not_counted():
    """A third arena has no game of the two; the pursuer wins that of the first."""
    scenario = in_arenas(GAME, [NARROW, WIDE, NARROW]).scenario
    results = Results(jnp.array([Outcome.CAPTURED, Outcome.NO_RESULT]), jnp.array([3, 4]))
    counted = count_by_arena(scenario, results)
    assert (counted.wins, counted.games) == ((1, 0), (1, 1))
