"""The pursuers of "Watch it learn": one training of stage 1, saved after shares of it, and what
they catch.

python -m website.learners
"""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import jax

from apollonius.agents.store import describe, save_agent
from apollonius.arenas.file import to_dict
from apollonius.evaluate.match import Match, play_match
from apollonius.game.game import Game
from apollonius.game.presets import make_game
from apollonius.game.types import Outcome, Role
from apollonius.io.document import to_json
from apollonius.learn.dqn import DQNConfig
from apollonius.learn.fixed_target import FixedTargetConfig
from apollonius.learn.stage import TrainState
from apollonius.web.site import LEARNERS, LEARNING

COMMAND = "python -m website.learners"
ALGORITHM = DQNConfig(width=96, depth=3, learning_rate=1e-3)
"""A small network."""
CONFIG = FixedTargetConfig(env_steps=8_000_000, progress=10.0)
"""Progress weighs much, so that the first steps are seen early."""
PUPILS = {0: 0, 20: 2, 120: 12, 195: 20, 977: 100}
"""Chunks of the training after which a pursuer is shown, each with the share of the training [%].
"""
MEASURED = (60, 90, 160, 250, 300, 400, 500, 650, 800)
"""Other chunks after which one is measured, for the curve."""
BEST = "pursuer"
"""The agent of the zoo that a person meets in most levels."""
BLUES = ("still", "flee-aware")
GAMES, SEED = 1000, 1
RADIUS, SECONDS = 0.15, 20
"""Of the robots in levels of the page [m], and the time limit of the lesson [s]."""


def training_game() -> Game:
    """Return the paper's game as the page's lesson has it."""
    game = make_game("paper")
    wide = game.bodies.map(lambda bodies: replace(bodies[0], radius=RADIUS))
    return replace(
        game, pursuer=wide.pursuer, evader=wide.evader, max_steps=round(SECONDS / game.dt)
    )


def measured(game: Game, pursuer: str) -> dict[str, float]:
    """Return the share of blues that a player catches in a game, by the rule that they follow."""
    matches = {blue: play_match(Match.of_names(game, pursuer, blue, GAMES, SEED)) for blue in BLUES}
    return {
        blue: match.outcomes[Outcome.CAPTURED.name.lower()] / GAMES
        for blue, match in matches.items()
    }


def main() -> None:
    """Train; save and measure what has been learned after some chunks."""
    game = training_game()
    stage = CONFIG.make(ALGORITHM, game)
    state = stage.init(jax.random.key(0))
    curve: list[dict[str, float]] = []
    pupils: list[dict[str, Any]] = []

    def judge(state: TrainState, chunk: int) -> None:
        """Measure the pursuer as it is now, and save it if it is one of those that are shown."""
        share, env_steps = PUPILS.get(chunk), int(state.env_steps)
        with TemporaryDirectory() as folder:
            is_shown = chunk in PUPILS
            name = f"learner-{share}"
            path = (LEARNERS if is_shown else Path(folder)) / f"{name}.safetensors"
            side = state.learners[Role.PURSUER].learner
            network = side.average if chunk == stage.chunks else side.network
            training = {"command": COMMAND, "env_steps": env_steps}
            save_agent(describe(network, Role.PURSUER, to_dict(game), training), path)
            shares = measured(game, str(path))
        curve.append({"env_steps": env_steps, **shares})
        if is_shown:
            pupils.append(
                {"name": name, "label": f"{share}\u00a0%", "env_steps": env_steps, **shares}
            )
        print(f"{chunk} of {stage.chunks}: {env_steps:,} env steps, {shares}", flush=True)

    judge(state, 0)
    for chunk in range(1, stage.chunks + 1):
        state, _ = stage.step(state)
        if chunk in MEASURED or chunk in PUPILS:
            judge(state, chunk)
    pupils.append({"name": BEST, "label": "your red", "env_steps": None, **measured(game, BEST)})
    record = {"games": GAMES, "seconds": SECONDS, "curve": curve, "pupils": pupils}
    LEARNING.write_text(to_json(record, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
