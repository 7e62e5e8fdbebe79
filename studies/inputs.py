"""Which observation carries over to arenas that nobody has trained in?

    python -m studies.inputs --out runs/inputs

trains pursuers to catch an evader that stays, in the training arenas of `suite-v1`, one for each observation and seed:
all for as many env steps, then those that are quicker for as long as the slowest takes. Each is judged in the held-out
arenas, of kinds that training never saw. Written are `inputs.json` and `inputs.md`. Stopped or killed at any point, the
same command goes on where it was.
"""

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from apollonius.arenas.scenarios import scenario_game
from apollonius.errors import exit_status
from apollonius.evaluate.match import MatchResult
from apollonius.evaluate.round_robin import RoundRobin
from apollonius.game.by_side import BySide
from apollonius.jobs import Job
from apollonius.learn.config import RunConfig
from apollonius.learn.folder import agent_file
from apollonius.learn.learner_config import DQNConfig
from apollonius.learn.stage_config import StageConfig
from apollonius.reproduce.finding import Finding
from apollonius.show.markdown import markdown_table
from studies import driver

FASTER = {"encoded": 2.3, "rays": 1.6, "patch": 1.2, "ways": 1.0, "egocentric": 1.0}
"""The observations that are compared, and how many env steps a training with each takes in the time in which one with
`egocentric` takes one: of the medians that the runs' own metrics tell, on an idle core."""
AGENT = "P_stage1"
"""What a training leaves."""


@dataclass(frozen=True, kw_only=True)
class Inputs(driver.AbstractStudy):
    """A training of stage 1 for each observation, seed and budget."""

    name = "inputs"
    games: int = driver.option(1250, help="games with each in the held-out arenas (default: %(default)s)")
    seeds: int = driver.option(3)
    env_steps: int = driver.option(2_000_000, help="of each training (default: %(default)s)")

    @property
    def runs(self) -> dict[str, tuple[str, int, int]]:
        """By name the observation, the seed and the env steps."""
        found = {}
        for kind, timed in (("steps", False), ("time", True)):
            for observation, faster in FASTER.items():
                if not timed or faster > 1:
                    steps = round(self.env_steps * (faster if timed else 1))
                    found |= {f"{observation}-{kind}-{seed}": (observation, seed, steps) for seed in range(self.seeds)}
        return found

    def trainings(self) -> driver.Trainings:
        """By env steps, then by time where that gives others."""
        game = scenario_game("suite-v1/train")
        return {
            self.out / name: (
                RunConfig(
                    seed=seed,
                    stages="fixed-target",
                    game=game,
                    dqn=DQNConfig(observation=observation),
                    fixed_target=StageConfig(env_steps=steps, evaluations=2, evaluation_games=500),
                ),
                (AGENT,),
            )
            for name, (observation, seed, steps) in self.runs.items()
        }

    @property
    def matches(self) -> RoundRobin:
        """Each against an evader that stays, on the same starts in the held-out arenas."""
        pursuers = {name: str(agent_file(self.out / name, AGENT)) for name in self.runs}
        return RoundRobin(
            self.out / "matches",
            BySide(pursuers, {"still": "still"}),
            self.games,
            0,
            scenario_game("suite-v1/held-out"),
        )

    def jobs(self) -> Iterator[Sequence[Job]]:
        """The matches of each pursuer."""
        yield self.matches.jobs()

    def finding(self) -> Finding:
        """A row for each observation and budget."""
        results = self.matches.results()
        found = {pursuer: result for (pursuer, _), result in results.items()}
        return Finding("Observations that carry over", input_table(found, self.seeds), data=driver.as_data(results))


def input_table(found: Mapping[str, MatchResult], seeds: int) -> str:
    """How often the pursuers with each observation catch a standing evader, by budget: the mean over seeds with the
    least and the greatest, and that in the worst tenth of the arenas.
    """
    lines = []
    for kind, budget in (("steps", "as many env steps"), ("time", "as much time")):
        for observation in FASTER:
            results = [found[name] for seed in range(seeds) if (name := f"{observation}-{kind}-{seed}") in found]
            if results:
                rates = 100 * np.array([result.pursuer_win_rate for result in results])
                worst = 100 * np.array([result.arenas.worst for result in results if result.arenas])
                cells = [f"{np.mean(one):.1f} [{np.min(one):.1f}, {np.max(one):.1f}]" for one in (rates, worst)]
                lines.append([observation, budget, *cells])
    return markdown_table(["observation", "budget", "catches [%]", "in the worst tenth of the arenas [%]"], lines)


main = partial(driver.main, Inputs)

if __name__ == "__main__":
    sys.exit(exit_status(main))
