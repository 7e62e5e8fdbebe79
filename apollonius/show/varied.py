"""A sweep over numbers of a game as a picture: a curve for one number, a heat map for two."""

from pathlib import Path

from matplotlib.colors import LinearSegmentedColormap
from matplotlib.ticker import ScalarFormatter

from apollonius.evaluate.vary import VariedMatches
from apollonius.show import palette, style
from apollonius.show.curves import draw_rate

WHO_WINS = LinearSegmentedColormap.from_list("who wins", [palette.EVADER, palette.LIGHT["panel"], palette.PURSUER])
"""From values with which the pursuer wins no game to those with which it wins all."""


def draw_varied(varied: VariedMatches, path: Path) -> None:
    """Save how often the pursuer wins, over the values of one number or of two.

    A curve has its 95 % intervals as a band; a heat map has a line at half of the games. The game's own values are
    marked where they lie among the others.
    """
    pursuer, evader = (player.name for player in varied.match.players)
    first, *second = varied.variations
    label = f"the pursuer wins [% of {varied.match.games:,} games]"
    inside = all(
        min(one.values) <= own <= max(one.values) for one, own in zip(varied.variations, varied.own, strict=True)
    )
    with style.picture(path, width=5.4, height=4.2) as (axes,):
        if second:
            rates, across, up = 100 * varied.win_rates.T, first.values, second[0].values
            mesh = axes.pcolormesh(across, up, rates, cmap=WHO_WINS, vmin=0, vmax=100, shading="nearest")
            if min(rates.shape) > 1 and rates.min() < 50 < rates.max():
                axes.contour(across, up, rates, levels=[50.0], colors=palette.INK)
            if inside:
                axes.plot(*varied.own, "D", color=palette.PAPER, markeredgecolor=palette.INK, markersize=7)
            axes.figure.colorbar(mesh, ax=axes, label=label)
            axes.set_ylabel(second[0].field)
            axes.grid(visible=False)
        else:
            games = [varied.match.games] * len(first.values)
            wins = [round(result.pursuer_win_rate * result.games) for result in varied.results]
            draw_rate(axes, first.values, wins, games, palette.PURSUER, label)
            axes.xaxis.set_major_formatter(ScalarFormatter())  # 0.8, not 800m
            if inside:
                axes.axvline(varied.own[0], color=palette.INK, linestyle=":", linewidth=1)
            axes.set_ylim(0, 100)
            axes.set_ylabel(label)
        axes.set_xlabel(first.field)
        axes.set_title(f"{pursuer} (pursuer) against {evader} (evader)")
