"""Which observation carries over to arenas that nobody has trained in?

    python -m studies.inputs --out runs/inputs

trains pursuers to catch an evader that stays, in the training arenas of `suite-v1`, one for each observation and seed:
all for as many env steps, then all for as long as the slowest takes. Each is judged in the held-out arenas, of kinds
that training never saw. Written are `inputs.json` and `inputs.md`. Stopped or killed at any point, the same command
goes on where it was.
"""

import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from apollonius.arenas.scenarios import scenario_game
from apollonius.learn.config import RunConfig
from apollonius.learn.learner_config import DQNConfig
from apollonius.learn.stage_config import StageConfig
from studies import driver

INPUTS = ("encoded", "rays", "ways", "patch", "egocentric")
"""The observations that are compared."""
SPEED = {"encoded": 1.0, "rays": 1.0, "ways": 1.0, "patch": 1.0, "egocentric": 1.0}
"""Env steps of a training with each in the time of one with `egocentric`."""


@dataclass(frozen=True, kw_only=True)
class Inputs(driver.AbstractStudy):
    """A training of stage 1 for each observation, seed and budget."""

    name = "inputs"
    seeds: int = driver.option(3)
    env_steps: int = driver.option(2_000_000, help="of each training (default: %(default)s)")

    def run_of(self, observation: str, seed: int, timed: bool) -> Path:
        """The folder of a training."""
        return self.out / f"{observation}{'-timed' if timed else ''}-{seed}"

    def trainings(self) -> driver.Trainings:
        """By env steps, then by time where that gives others."""
        game, found = scenario_game("suite-v1/train"), {}
        for timed in (False, True):
            for seed in range(self.seeds):
                for observation in INPUTS:
                    steps = round(self.env_steps * (SPEED[observation] if timed else 1))
                    if timed and steps == self.env_steps:
                        continue
                    config = RunConfig(
                        seed=seed,
                        stages="fixed-target",
                        game=game,
                        dqn=DQNConfig(observation=observation),
                        fixed_target=StageConfig(env_steps=steps, evaluations=2, evaluation_games=500),
                    )
                    found[self.run_of(observation, seed, timed)] = (config, ("P_stage1",))
        return found


main = partial(driver.main, Inputs)

if __name__ == "__main__":
    from apollonius.errors import exit_status

    sys.exit(exit_status(main))
