"""What the runs of `schemes` are judged by: how much their agents lose to responses, to the zoo, and to each other."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from apollonius.catalogue import find_player
from apollonius.document import write_atomically
from apollonius.evaluate.round_robin import RoundRobin
from apollonius.exploit.attack import Attack, LossRate, judge_opponent
from apollonius.exploit.responses import kept_response, train_response
from apollonius.game.types import Role
from apollonius.jobs import ShouldStop
from apollonius.learn.folder import agent_file, load_config
from apollonius.learn.learner_config import DQNConfig

ZOO = {Role.PURSUER: ("P_curriculum", "P_scratch"), Role.EVADER: ("E_curriculum", "E_scratch")}
"""The paper's agents of either side."""
RATING_SEED = 2
"""Of the starts in the tournament of all last agents."""
FIRST: dict[Role, str | None] = {role: names[0] for role, names in ZOO.items()}
"""The agents that responses go on from."""
QUICK = DQNConfig(averaging=3e-3, games=256, replay_capacity=262_144)
"""How a response learns in some hundred thousand env steps: its weights are averaged over three hundred updates."""


@dataclass(frozen=True)
class Effort:
    """How thoroughly runs are judged."""

    response_env_steps: int = 500_000
    """Training of a response to a final agent; responses to earlier ones get half."""
    games: int = 500
    """Games that judge a response, and in each match with an agent of the zoo."""
    rating_games: int = 100
    """Games in each match of the tournament of all final agents."""


def judge_run(run: Path, effort: Effort, whole_curve: bool, should_stop: ShouldStop) -> bool:
    """Write a run's `judged.json`: for both sides, how much the agents kept lose. It goes on where it was stopped.

    Args:
        run: a finished run of self-play from a given pursuer.
        whole_curve: judge all agents that were kept on the way, not the last ones only.
    """
    path = run / "judged.json"
    judged: dict[str, Any] = json.loads(path.read_text()) if path.exists() else {}
    percents = load_config(run / "config.toml").self_play.snapshot_percents
    for percent in reversed(percents if whole_curve else percents[-1:]):
        for role in Role:
            name = f"{role.name.lower()}-{percent}"
            if name in judged:
                continue
            if should_stop():
                return False
            attack = Attack(
                role,
                str(agent_file(run, f"{role.name[0]}_curriculum", percent)),
                env_steps=effort.response_env_steps // (1 if percent == percents[-1] else 2),
                first=FIRST[Role.EVADER if role == Role.PURSUER else Role.PURSUER],
                dqn=QUICK,
            )
            judged[name] = losses(attack, run / "responses" / name, effort.games)
            write_atomically(path, json.dumps(judged, indent=1).encode())
    return True


def losses(attack: Attack, folder: Path, games: int) -> dict[str, Any]:
    """How often an agent loses to a response that learned to beat it, and to the paper's agents; `most` is the largest
    of these rates: near a lower bound of its exploitability, a little too large as the largest of estimates.
    """
    train_response(attack, folder, seed=0)
    against = {"response": _brief(judge_opponent(attack, kept_response(folder, 0), games))}
    for name in ZOO[attack.other]:
        against[name] = _brief(judge_opponent(attack, find_player(name, attack.other).policy, games))
    return {"most": max(loss["rate"] for loss in against.values()), "against": against}


def _brief(loss: LossRate) -> dict[str, Any]:
    return {"rate": loss.rate, "interval": loss.interval, "outcomes": loss.match.outcomes}


def last_agent(run: Path, role: Role) -> str:
    """File of a run's agent of one side, at its end."""
    return str(agent_file(run, f"{role.name[0]}_curriculum"))


def entrants(runs: Sequence[Path], role: Role) -> dict[str, str]:
    """Who takes part in the tournament on one side: a name for each, and the agent or its file."""
    own = {f"{run.parent.name}/{run.name}": last_agent(run, role) for run in runs}
    return own | {name: name for name in ZOO[role]}


def everyone(out: Path, runs: Sequence[Path], effort: Effort) -> RoundRobin:
    """The tournament of all runs' last agents and the paper's, in the order of `entrants`."""
    pursuers, evaders = (entrants(runs, role) for role in Role)
    return RoundRobin(out / "tournament", pursuers, evaders, effort.rating_games, RATING_SEED)
