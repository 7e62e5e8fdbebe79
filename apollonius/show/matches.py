"""Pictures of many matches: a tournament with its ratings, and sweeps over numbers of a game."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap

from apollonius.evaluate.tournament import Tournament
from apollonius.evaluate.vary import VariedMatches
from apollonius.show import palette, style
from apollonius.show.style import draw_rate


def draw_tournament(tournament: Tournament, path: Path) -> None:
    """Save two panels: the pursuers' win rates, and Elo ratings with 95 % intervals."""
    height = max(3.6, 1.6 + 0.24 * (len(tournament.pursuers) + len(tournament.evaders)))
    with style.picture(path, columns=2, width=4.8, height=height) as (table, elo):
        _draw_win_rates(table, tournament)
        _draw_ratings(elo, tournament)


def _draw_win_rates(axes: Axes, tournament: Tournament) -> None:
    """Draw the pursuers' win rates [%], a row each, as colours and figures."""
    rates = 100 * tournament.win_rates
    colours = axes.imshow(rates, cmap="RdBu_r", vmin=0, vmax=100, aspect="auto")
    axes.set_xticks(
        range(len(tournament.evaders)), tournament.evaders, rotation=45, ha="right", fontsize=7
    )
    axes.set_yticks(range(len(tournament.pursuers)), tournament.pursuers, fontsize=7)
    axes.grid(visible=False)
    if rates.size <= 200:
        for (row, column), value in np.ndenumerate(rates):
            colour = "white" if abs(value - 50) > 35 else palette.INK
            axes.text(
                column, row, f"{value:.0f}", ha="center", va="center", fontsize=6, color=colour
            )
    axes.set(title="who beats whom", xlabel="evader", ylabel="pursuer")
    label = "the pursuer wins [% of games]"
    axes.figure.colorbar(colours, ax=axes, location="bottom", label=label, fraction=0.05, aspect=30)


def _draw_ratings(axes: Axes, tournament: Tournament) -> None:
    """Draw Elo ratings of both sides, each with its 95 % interval."""
    for rated, first, colour, label, sign in (
        (tournament.ratings.pursuer, 0, palette.PURSUER, "pursuers", "o"),
        (tournament.ratings.evader, len(tournament.pursuers), palette.EVADER, "evaders", "D"),
    ):
        lines = first + np.arange(len(rated.points))
        axes.errorbar(
            rated.points,
            lines,
            xerr=rated.half_widths,
            fmt=sign,
            color=colour,
            markersize=4,
            label=label,
        )
    names = [*tournament.pursuers, *tournament.evaders]
    axes.set_yticks(range(len(names)), names, fontsize=7)
    axes.invert_yaxis()
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0, ncols=2)
    axes.set(title="how strong everyone is", xlabel="Elo [points], with 95 % intervals")


WHO_WINS = LinearSegmentedColormap.from_list(
    "who wins", [palette.EVADER, palette.LIGHT["panel"], palette.PURSUER]
)
"""From values with which the pursuer wins no game to those with which it wins all."""


def draw_varied(varied: VariedMatches, path: Path) -> None:
    """Save how often the pursuer wins, over the values of one number or of two.

    A curve has its 95 % intervals as a band; a heat map has a line at half of the games.
    """
    pursuer, evader = (player.name for player in varied.match.players)
    first, *second = varied.variations
    label = f"the pursuer wins [% of {varied.match.games:,} games]"
    with style.picture(path, width=5.4, height=4.2) as (axes,):
        if second:
            rates = 100 * varied.win_rates.T
            across = first.values
            up = second[0].values
            mesh = axes.pcolormesh(
                across, up, rates, cmap=WHO_WINS, vmin=0, vmax=100, shading="nearest"
            )
            if min(rates.shape) > 1 and rates.min() < 50 < rates.max():
                axes.contour(across, up, rates, levels=[50.0], colors=palette.INK)
            axes.figure.colorbar(mesh, ax=axes, label=label)
            axes.set_ylabel(second[0].field)
            axes.grid(visible=False)
        else:
            games = [varied.match.games] * len(first.values)
            wins = [result.pursuer_wins for result in varied.results]
            draw_rate(axes, first.values, wins, games, palette.PURSUER, label)
            axes.set(ylabel=label, ylim=(0, 100))
        axes.set(title=f"{pursuer} (pursuer) against {evader} (evader)", xlabel=first.field)
