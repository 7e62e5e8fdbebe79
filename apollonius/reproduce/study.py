"""A study: the paper's six agents, trained with several seeds, and the matches between them."""

from dataclasses import dataclass, field, replace
from pathlib import Path

from apollonius import Match, NamedPlayer, Role, find_player
from apollonius.evaluate.match import MatchResult, count_results, play_games
from apollonius.game.types import BySide
from apollonius.learn.config import PRESETS, RunConfig
from apollonius.learn.folder import agent_file
from apollonius.learn.metrics import MetricsLine, load_metrics
from apollonius.play.playout import Report, Results, no_report

AGENTS = {
    "curriculum": ["P_stage1", "P_curriculum", "E_curriculum"],
    "scratch": ["P_scratch", "E_scratch"],
    "random": ["P_random"],
}
"""The agents that come from each training run."""
RUN_OF = {agent: run for run, agents in AGENTS.items() for agent in agents}
MATCH_SEED = 0
"""Seed of the starts of every match: all pairings meet the same ones."""


def run_configs(preset: RunConfig, seed: int) -> dict[str, RunConfig]:
    """Return the three trainings of one seed, by name.

    `curriculum`: stage 1, then self-play. `scratch`: self-play of the same length, both sides from
    random weights (section V-A). `random`: a pursuer against a random evader (section V-B), for
    half the env steps of both stages: its games are so much shorter that this is more episodes than
    those of both stages.
    """
    stage_1, stage_2 = preset.stages
    half = (stage_1.env_steps + stage_2.env_steps) // 2
    against_random = replace(stage_1, env_steps=half, evaders=("random",))
    stages = {
        "curriculum": preset.stages,
        "scratch": (replace(stage_2, pursuer_epsilon=1.0),),
        "random": (against_random,),
    }
    return {name: replace(preset, seed=seed, stages=own) for name, own in stages.items()}


@dataclass
class Study:
    """The agents of a study, and their matches, each played once."""

    folder: Path
    budget: str
    """The preset by which its agents are trained."""
    seeds: tuple[int, ...]
    games: int = 10_000
    """Games in a match."""
    progress: Report = no_report
    _played: dict[tuple[str, str, int, int, int], Results] = field(default_factory=dict, repr=False)

    def run(self, name: str, seed: int) -> Path:
        return self.folder / f"seed-{seed}" / name

    def agent(self, name: str, role: Role, seed: int, percent: int = 100) -> NamedPlayer:
        """Find an agent.

        Args:
            name: One of `RUN_OF`, or a player such as `random` or `still`.
            role: The agent's side.
            seed: Seed of its training.
            percent: Part of self-play after which it is taken [%].
        """
        player = (
            str(agent_file(self.run(RUN_OF[name], seed), name, percent)) if name in RUN_OF else name
        )
        return replace(find_player(player, role, PRESETS[self.budget].game), name=name)

    def pairing(
        self, pursuer: str, evader: str, seeds: tuple[int, int], percent: int = 100
    ) -> Match:
        """Make the match between two agents, as `agent` finds them.

        Args:
            pursuer: Name of the pursuer.
            evader: Name of the evader.
            seeds: Seeds of their trainings.
            percent: Part of self-play after which they are taken [%].
        """
        chasing = self.agent(pursuer, Role.PURSUER, seeds[0], percent)
        fleeing = self.agent(evader, Role.EVADER, seeds[1], percent)
        return Match(PRESETS[self.budget].game, BySide(chasing, fleeing), self.games, MATCH_SEED)

    def play(
        self,
        pursuer: str,
        evader: str,
        seeds: tuple[int, int],
        percent: int = 100,
        report: Report | None = None,
    ) -> Results:
        """Play the match between two agents once; return its results.

        Args:
            pursuer: Name of the pursuer.
            evader: Name of the evader.
            seeds: Seeds of their trainings.
            percent: Part of self-play after which they are taken [%].
            report: Called with the finished games and all games; `progress` for None.
        """
        key = (pursuer, evader, *seeds, percent)
        if key not in self._played:
            self._played[key] = play_games(
                self.pairing(pursuer, evader, seeds, percent), report=report or self.progress
            )
        return self._played[key]

    def matches(self, pursuer: str, evader: str, percent: int = 100) -> list[list[MatchResult]]:
        """Return the matches of every training of the pursuer with every one of the evader, where
        that is trained.

        Args:
            pursuer: Name of the pursuer.
            evader: Name of the evader.
            percent: Part of self-play after which they are taken [%].
        """
        evaders = self.seeds if evader in RUN_OF else self.seeds[:1]

        def result(row: int, column: int) -> MatchResult:
            before = self.games * (row * len(evaders) + column)

            def report(games: int, total: int) -> None:
                self.progress(before + games, self.games * len(self.seeds) * len(evaders))

            seeds = self.seeds[row], evaders[column]
            return count_results(
                self.pairing(pursuer, evader, seeds, percent),
                self.play(pursuer, evader, seeds, percent, report),
            )

        return [
            [result(row, column) for column in range(len(evaders))]
            for row in range(len(self.seeds))
        ]

    def metrics(self, name: str, seed: int, stage: str) -> list[MetricsLine]:
        return [
            line
            for line in load_metrics(self.run(name, seed) / "metrics.jsonl")
            if line.stage == stage
        ]

    def trainings(self) -> dict[Path, tuple[RunConfig, list[str]]]:
        """Return by folder the training, and the agents of the finished run."""
        return {
            self.run(name, seed): (config, AGENTS[name])
            for seed in self.seeds
            for name, config in run_configs(PRESETS[self.budget], seed).items()
        }
