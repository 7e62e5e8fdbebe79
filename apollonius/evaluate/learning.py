"""Learning curves of a training: win rates of its agents against fixed opponents, from stage to
stage and within each.
"""

from dataclasses import dataclass
from pathlib import Path

from apollonius.evaluate.match import Match, play_matches
from apollonius.evaluate.pairings import last_agents
from apollonius.game.types import BySide, Role
from apollonius.learn.config import FIXED_TARGET, SELF_PLAY, RunConfig
from apollonius.learn.folder import METRICS
from apollonius.learn.metrics import load_metrics
from apollonius.play.playout import Report, no_report

OPPONENTS = BySide(pursuer="flee-aware", evader="pure-pursuit")
"""The rules that a pursuer and an evader of self-play are measured by; no training of theirs meets
them.
"""
GAMES = 300
"""Games of each match with such a rule."""


@dataclass(frozen=True)
class Curve:
    """Win rate of one agent in the course of its stage."""

    title: str
    wins: dict[int, float]
    """Share of games, by per cent of the stage."""


def learning_curves(run: Path, config: RunConfig, report: Report = no_report) -> list[Curve]:
    """Measure the stages of a finished run: stage 1 by its evaluations, self-play by matches of its
    snapshots.

    Self-play begins with the pursuer of stage 1, where there is one.
    """
    curves = [stage1_curve(run, config)] if FIXED_TARGET in config.by_name else []
    if SELF_PLAY not in config.by_name:
        return curves
    matches = {
        (role, percent): _match(config, role, file)
        for role in Role
        for percent, file in snapshots(run, config, role).items()
    }
    results = dict(zip(matches, play_matches([*matches.values()], report=report), strict=True))
    for role in Role:
        own = {percent: result for (side, percent), result in results.items() if side == role}
        if role == Role.PURSUER:
            about = f"self-play: pursuer beats {OPPONENTS.pursuer}"
            wins = {percent: result.pursuer_win_rate for percent, result in own.items()}
        else:
            about = f"self-play: evader escapes {OPPONENTS.evader}"
            wins = {percent: result.evader_undefeated_rate for percent, result in own.items()}
        curves.append(Curve(about, wins))
    return curves


def stage1_curve(run: Path, config: RunConfig) -> Curve:
    """Read how often the pursuer of stage 1 captured in its evaluations."""
    stage = config.by_name[FIXED_TARGET]
    wins: dict[int, float] = {}
    for line in load_metrics(run / METRICS):
        if line.stage == FIXED_TARGET and line.evaluation is not None:
            outcomes = line.evaluation.outcomes
            wins[round(100 * line.env_steps / stage.env_steps)] = outcomes["captured"] / sum(
                outcomes.values()
            )
    return Curve(f"stage 1: pursuer catches {', '.join(stage.opponent_names)}", wins)


def snapshots(run: Path, config: RunConfig, role: Role) -> dict[int, Path]:
    """Return the files of one side's agents in self-play by per cent of the stage, from its
    beginning.
    """
    name = config.agent_name(SELF_PLAY, role)
    files: dict[int, Path] = {}
    if role == Role.PURSUER and FIXED_TARGET in config.by_name:
        first = last_agents(run).get(config.agent_name(FIXED_TARGET, role))
        if first is not None:
            files[0] = first
    for file in run.glob(f"agents/{name}-*.safetensors"):
        files[int(file.stem.rpartition("-")[2])] = file
    files[100] = run / "agents" / f"{name}.safetensors"
    return dict(sorted(files.items()))


def _match(config: RunConfig, role: Role, agent: Path) -> Match:
    opponent = OPPONENTS[role]
    pair = (str(agent), opponent) if role == Role.PURSUER else (opponent, str(agent))
    return Match.of_names(config.game, *pair, games=GAMES, seed=2)
