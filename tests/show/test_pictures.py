"""Pictures show what they are given: shapes to scale, means of seeds, bars, and a network's own values."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from matplotlib.colors import to_hex, to_rgba
from matplotlib.figure import Figure
from PIL import ImageColor

from apollonius.agents.greedy import Greedy
from apollonius.agents.network import make_network
from apollonius.evaluate.statistics import wilson_interval
from apollonius.game.polygon import Polygon
from apollonius.game.presets import make_game
from apollonius.game.types import GameState, RobotState, Role
from apollonius.observe.view import look
from apollonius.show import palette, style
from apollonius.show.arena import draw_arena
from apollonius.show.palette import DARK, LIGHT
from apollonius.show.slices import _TURNS, _draw_actions, slice_values
from apollonius.show.style import draw_rate, draw_seeds, draw_strips, smooth


@pytest.fixture
def axes():
    return Figure().subplots()


def test_obstacles_and_the_territory_are_drawn_where_they_are(axes):
    corners = ((4.0, 8.0), (6.0, 8.0), (5.0, 9.0))
    arena = replace(make_game("territory").arena, polygons=(Polygon(corners),))
    draw_arena(axes, arena)
    *discs, polygon, ring, _ = axes.patches
    for patch, disc in zip([*discs, ring], [*arena.discs, arena.territory], strict=True):
        away = np.hypot(*(patch.get_xy() - (disc.x, disc.y)).T)
        np.testing.assert_allclose(away, disc.radius, rtol=1e-5)
    np.testing.assert_array_equal(polygon.get_xy(), [*corners, corners[0]])
    assert [patch.get_fill() for patch in axes.patches[-3:]] == [True, False, False]
    assert to_hex(ring.get_edgecolor()) == palette.EVADER
    assert axes.get_aspect() == 1.0
    for (low, high), (least, most) in zip((axes.get_xlim(), axes.get_ylim()), ((0, 10), (0, 10)), strict=True):
        assert low < least < most < high


def test_seeds_have_a_mean_and_a_band_over_what_all_cover_and_a_lone_seed_none(axes):
    draw_seeds(axes, [([0.0, 10.0, 20.0], [0.0, 1.0, 2.0]), ([5.0, 15.0, 25.0], [2.5, 2.5, 2.5])], "red", "reward")
    *seeds, mean = axes.get_lines()
    assert len(seeds) == 2
    np.testing.assert_allclose(mean.get_xydata()[[0, -1]], [[5, (0.5 + 2.5) / 2], [20, (2 + 2.5) / 2]])
    assert mean.get_label() == "reward: mean of 2 seeds, 95 % band"
    (band,), half = axes.collections, 12.7062047 / 2  # of Student's t with 1 degree of freedom
    low, high = band.get_datalim(axes.transData).get_points()[:, 1]
    np.testing.assert_allclose([low, high], [1.5 - 2 * half, 1.5 + 2 * half])
    alone = Figure().subplots()
    draw_seeds(alone, [([0, 10], [0.0, 1.0])], "red", "reward")
    assert not alone.collections
    assert [line.get_label() for line in alone.get_lines()] == ["reward"]


def test_a_rate_has_wilsons_interval_as_its_band(axes):
    draw_rate(axes, [0, 100], [5, 10], [10, 10], "red", "captured")
    (line,), (band,) = axes.get_lines(), axes.collections
    np.testing.assert_allclose(line.get_xydata(), [[0, 50], [100, 100]])
    corners = band.get_paths()[0].vertices
    for x, times in ((0, 5), (100, 10)):
        for end in wilson_interval(times, 10):
            assert np.isclose(corners, [x, 100 * end]).all(axis=1).any()


def test_an_inline_figure_takes_its_colours_from_the_page():
    def draw(axes):
        axes.plot([0, 1], [0, 1], color=palette.PURSUER, label="pursuer")
        axes.set_xlabel("episodes & <more>")

    drawn = style.inline_svg(draw, "a curve")
    assert drawn == style.inline_svg(draw, "a curve")
    assert drawn.startswith('<svg role="img" aria-label="a curve"')
    assert "var(--pursuer)" in drawn
    assert "var(--ink)" in drawn
    assert not any(colour in drawn for colour in (palette.PURSUER, palette.INK, palette.GRID, "http"))
    assert "episodes &amp; &lt;more&gt;" in drawn


def test_running_means_are_of_neighbours():
    assert smooth([1.0, 1.0, 4.0, 1.0, 1.0], 3) == pytest.approx([1, 2, 2, 2, 1])


def test_strips_have_a_dot_for_each_pair_of_trainings_and_an_interval_beside_them(axes):
    draw_strips(axes, ["a", "b"], [[[0.5, 0.6], [0.25, 0.3]], [[0.9]]], [(0.2, 0.7), (0.8, 1.0)])
    dots = [(line.get_xdata(), line.get_ydata(), line.get_color()) for line in axes.lines if line.get_marker() == "o"]
    joined = [line.get_ydata().tolist() for line in axes.lines if line.get_marker() != "o"]
    assert joined == [[50, 25], [60, 30], [90]]
    assert [y.tolist() for _, y, _ in dots] == [[50, 60], [25, 30], [90]]
    assert [list(x) for x, _, _ in dots] == [[-0.15] * 2, [0.15] * 2, [1.0]]
    assert dots[0][2] != dots[1][2]
    assert [path.vertices[:, 1].tolist() for bars in axes.collections for path in bars.get_paths()] == [
        [20, 70],
        [80, 100],
    ]
    assert [label.get_text() for label in axes.get_xticklabels()] == ["a", "b"]


def luminance(colour):
    """WCAG 2's relative luminance of a colour."""
    c = np.array(ImageColor.getrgb(colour)) / 255
    return float(np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4) @ [0.2126, 0.7152, 0.0722])


def contrast(*colours):
    low, high = sorted(map(luminance, colours))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("theme", [LIGHT, DARK], ids=["light", "dark"])
def test_words_can_be_read_and_shapes_seen(theme):
    assert contrast("#767676", "#ffffff") == pytest.approx(4.54, abs=0.01)
    for ground in ("paper", "panel"):
        assert min(contrast(theme[name], theme[ground]) for name in ("ink", "quiet", "pursuer", "evader")) >= 4.5
    assert min(contrast(theme[name], theme["paper"]) for name in ("obstacle", "other")) >= 3


OPPONENT = RobotState(*map(jnp.float32, (7.5, 7.0, 0.4, -1.0)))
OWN = (0.6, 0.8)


@pytest.fixture
def network():
    return make_network("encoded", width=8, depth=2, key=jax.random.key(1))


@pytest.mark.parametrize("role", Role)
def test_every_cell_has_the_networks_values_there(network, role):
    game = make_game("paper")
    x, y, values = slice_values(Greedy(network), game, role, OWN, OPPONENT, cells=8)
    np.testing.assert_allclose(x, np.arange(8) * 1.25 + 0.625)
    assert values.shape == (8, 8, 9)
    for row, column in ((0, 0), (2, 5), (7, 1)):
        own = RobotState(*map(jnp.float32, (x[column], y[row], *OWN)))
        pursuer, evader = (own, OPPONENT) if role == Role.PURSUER else (OPPONENT, own)
        observation = network.observation(look(game, GameState.of_two(pursuer, evader, jnp.int32(0)), role))
        np.testing.assert_allclose(values[row, column], network(observation), atol=1e-5)


def test_there_is_no_value_where_the_body_cannot_be(network):
    game = make_game("robot")
    x, y, values = slice_values(Greedy(network), game, Role.PURSUER, OWN, OPPONENT, cells=200)
    missing = np.isnan(values[..., 0])
    x, y = np.meshgrid(x, y)
    for disc in game.arena.discs:
        away = np.hypot(x - disc.x, y - disc.y)
        assert missing[away < disc.radius + 0.14].all()
        assert not missing[(away > disc.radius + 0.2) & (away < disc.radius + 0.5)].any()
    assert missing[0].all()
    assert not missing[10, 10]


def test_the_turn_of_the_best_action_is_a_colour_and_its_acceleration_a_sign():
    places = np.arange(32.0)
    best = (places // 11 + 3 * (places[:, None] // 11)).astype(int)
    values = np.eye(9)[best]
    values[:2] = np.nan
    axes = Figure().subplots()
    _draw_actions(axes, (places, places, values))
    (mesh,), chosen = axes.collections, np.arange(1, 32, 2)
    colours, turns = mesh.to_rgba(mesh.get_array()), [to_rgba(colour) for colour in _TURNS.values()]
    np.testing.assert_allclose(colours[2:], np.array(turns)[best % 3][2:])
    assert mesh.get_array().mask[:2].all()
    for level, line in enumerate(axes.lines):
        rows, columns = np.nonzero(best[np.ix_(chosen, chosen)][1:] // 3 == level)
        np.testing.assert_array_equal(line.get_xydata(), np.stack([chosen[columns], chosen[rows + 1]], axis=1))
