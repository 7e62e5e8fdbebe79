"""Fig. 8: where P_random fails against E_scratch and P_curriculum wins, from the same starts."""

import jax.numpy as jnp

from apollonius import Outcome
from apollonius.evaluate.match import replay_game
from apollonius.game.outcome import pursuer_wins
from apollonius.reproduce.finding import Finding
from apollonius.reproduce.study import Study
from apollonius.show import style
from apollonius.show.arena import draw_game
from apollonius.show.words import describe_end


def run(study: Study) -> Finding:
    """The first game in which P_random crashes and P_curriculum wins, side by side; else the first that it loses."""
    seed = study.seeds[0]
    ours, theirs = (study.play(name, "E_scratch", seed).outcome for name in ("P_curriculum", "P_random"))
    wanted = pursuer_wins(ours) & (theirs == Outcome.PURSUER_HIT_OBSTACLE)
    if not wanted.any():
        wanted = theirs != Outcome.CAPTURED
    index, ends = int(jnp.argmax(wanted)), []
    with style.picture(study.folder / "figure8.png", columns=2, width=3.6, height=4.0) as panels:
        for axes, name in zip(panels, ("P_random", "P_curriculum"), strict=True):
            game = replay_game(study.pairing(name, "E_scratch", seed), index)
            draw_game(axes, study.game, game, f"{name} against E_scratch")
            ends.append(f"{name}: {describe_end(study.game, game)}")
    text = f"Game {index} of the match. {'; '.join(ends)}."
    return Finding("Fig. 8: the same start", text, ("figure8.png",), data={"game": index, "ends": ends})
