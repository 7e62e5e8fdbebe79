"""Who meets whom when the agents of a training run are judged."""

from collections.abc import Iterable
from pathlib import Path


def last_agents(run: Path) -> dict[str, Path]:
    """Files of the agents at the end of a run's stages by name; those kept on the way are left out."""
    return {path.stem: path for path in sorted(run.glob("agents/*.safetensors")) if "-" not in path.stem}


def pairings(names: Iterable[str]) -> list[tuple[str, str]]:
    """Pursuer and evader of every match between agents of these names and the players that need no training.

    The pursuer of stage 1 meets an evader that stays, as in its training; any other the random evader and all evaders.
    """
    names = list(names)
    evaders = ["random", *[name for name in names if name.startswith("E_")]]
    return [
        (name, opponent)
        for name in names
        if name.startswith("P_")
        for opponent in (["still"] if name == "P_stage1" else evaders)
    ]
