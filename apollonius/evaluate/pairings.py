"""The matches by which the agents at the end of a training run are judged."""

import re
from collections.abc import Callable, Mapping
from pathlib import Path

from apollonius.agents.store import load_header
from apollonius.evaluate.match import Match, MatchResult, play_matches
from apollonius.game.game import Game
from apollonius.io.document import to_json, write_atomically
from apollonius.play.playout import Report, no_report

EVALUATION = "evaluation.json"
"""Name of the file in a run's folder with its final matches."""
JUDGED_GAMES = 2000
"""Games of each match that judges a run."""


def last_agents(run: Path) -> dict[str, Path]:
    """Return the files of a run's final agents by name, without earlier snapshots, whose names end
    with a percentage.
    """
    files = sorted(run.glob("agents/*.safetensors"))
    return {path.stem: path for path in files if not re.search(r"-\d+$", path.stem)}


def pairings(agents: Mapping[str, Path]) -> list[tuple[str, str]]:
    """Return the names of pursuer and evader in each match of these agents and of players that need
    no training.

    The pursuer of stage 1 meets an evader that stays, as in its training; any other the random
    evader and all evaders.
    """
    roles = {name: load_header(file).role for name, file in agents.items()}
    evaders = ["random", *[name for name, role in roles.items() if role == "evader"]]
    return [
        (name, opponent)
        for name, role in roles.items()
        if role == "pursuer"
        for opponent in (["still"] if name == "P_stage1" else evaders)
    ]


def last_matches(run: Path, game: Game, games: int, seed: int) -> dict[tuple[str, str], Match]:
    """Make the matches of a run's last agents, by the names that the agents have in the run.

    Args:
        run: Folder of the run.
        game: The game.
        games: Number of games of each match.
        seed: Seed of each match.
    """
    agents = last_agents(run)

    def file(name: str) -> str:
        return str(agents.get(name, name))

    return {
        (pursuer, evader): Match.of_names(game, file(pursuer), file(evader), games, seed)
        for pursuer, evader in pairings(agents)
    }


def evaluate_run(
    run: Path,
    game: Game,
    on_match: Callable[[Match, MatchResult], None] = lambda match, result: None,
    report: Report = no_report,
) -> None:
    """Play the matches of a run's last agents, and write their results to its `EVALUATION`.

    Args:
        run: Folder of the run.
        game: The game.
        on_match: Called with each match and its result.
        report: Called with the games so far and in all.
    """
    matches = last_matches(run, game, JUDGED_GAMES, seed=1)
    results = play_matches([*matches.values()], on_match, report)
    by_pair = zip(matches, results, strict=True)
    record = {" against ".join(pair): result.to_dict() for pair, result in by_pair}
    write_atomically(run / EVALUATION, to_json(record, indent=2).encode())
