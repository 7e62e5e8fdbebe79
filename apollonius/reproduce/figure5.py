"""Fig. 5: the same start at three moments of self-play."""

from apollonius.evaluate.match import replay_game
from apollonius.reproduce.finding import Finding
from apollonius.reproduce.study import Study
from apollonius.show import style
from apollonius.show.arena import draw_game
from apollonius.show.words import describe_end

MOMENTS = (25, 75, 100)
"""Percentages of self-play, where agents are kept; the paper shows 23, 80 and 100 %."""


def run(study: Study) -> Finding:
    """The first game of the match between both sides of the first seed, as they were at each moment."""
    seed, ends = study.seeds[0], []
    with style.picture(study.folder / "figure5.png", columns=len(MOMENTS), width=3.4, height=3.8) as panels:
        for axes, percent in zip(panels, MOMENTS, strict=True):
            game = replay_game(study.pairing("P_curriculum", "E_curriculum", seed, percent), index=0)
            draw_game(axes, study.game, game, f"after {percent} % of self-play")
            ends.append(describe_end(study.game, game))
    moments = "; ".join(f"{percent} %: {end}" for percent, end in zip(MOMENTS, ends, strict=True))
    return Finding("Fig. 5: one start as self-play goes on", f"{moments}.", ("figure5.png",), data={"ends": ends})
