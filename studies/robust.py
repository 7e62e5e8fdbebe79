"""How much of the gap between the rules and robots with bodies does training with disturbed robots close?

    python -m studies.robust --config examples/robust.toml --out runs/robust --seeds 3

trains the self-play of that file with every seed, one process on every core, then plays the agents it goes on from,
those it came to and strangers against each other, by the rules and with bodies in MuJoCo, and writes `robust.json` and
`robust.md`. Stopped or killed at any point, the same command goes on where it was.
"""

import argparse
import json
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from apollonius.agents.disturbance import NONE
from apollonius.agents.kind import fingerprint
from apollonius.arenas.record import to_dict
from apollonius.bodies.comparison import compare
from apollonius.bodies.drive import Drive
from apollonius.bodies.physics import Physics
from apollonius.bodies.simulation import simulate_match
from apollonius.catalogue import find_player
from apollonius.document import write_atomically
from apollonius.errors import InvalidInput, exit_status, require
from apollonius.evaluate.match import Match, play_games
from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.jobs import STOPPED, Job, ShouldStop, run_jobs
from apollonius.learn.config import RunConfig
from apollonius.learn.folder import agent_file, load_config
from apollonius.learn.trainings import train_runs
from studies.driver import add_workers, chosen_cores
from studies.robust_report import Comparisons, write_results

AGENTS = {Role.PURSUER: "P_curriculum", Role.EVADER: "E_curriculum"}
"""What the agents of a run of self-play are called."""


@dataclass(frozen=True)
class Meeting:
    """A match to be played by the rules and with bodies. Plain data, so that any process can play it.

    Attributes:
        file: where its results are kept.
        game: by whose rules.
        pursuer, evader: the agents or their files.
        games: how many, by the rules and with bodies.
        seed: of the starts.
    """

    file: Path
    game: Game
    pursuer: str
    evader: str
    games: int
    seed: int

    def play(self, should_stop: ShouldStop) -> bool:
        """Play the match and keep it. Returns False if there was no time to begin."""
        if should_stop():
            return False
        match = self.match
        comparison = compare(match, play_games(match), simulate_match(match, Drive()))
        record = {"of": self.asked, "comparison": comparison.to_dict()}
        self.file.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(self.file, json.dumps(record, indent=1).encode())
        return True

    def comparison(self) -> dict[str, Any]:
        """What was kept, as `Comparison.to_dict` has it.

        Raises:
            InvalidInput: when it is of other agents, games or starts.
        """
        record = json.loads(self.file.read_text())
        require(record["of"] == self.asked, "--out", self.file, "another folder: this match is of others")
        return record["comparison"]

    @property
    def asked(self) -> dict[str, Any]:
        """All that the results depend on; agents are told apart by their numbers."""
        match = self.match
        prints = [fingerprint(player.policy) for player in (match.pursuer, match.evader)]
        numbers = {"games": self.games, "seed": self.seed}
        return {"agents": prints, "game": to_dict(self.game), "drive": to_dict(Drive()), **numbers}

    @property
    def match(self) -> Match:
        """The same with its players."""
        pursuer = find_player(self.pursuer, Role.PURSUER, self.game)
        evader = find_player(self.evader, Role.EVADER, self.game)
        return Match(self.game, pursuer, evader, self.games, self.seed)


def entrants(config: RunConfig, runs: Mapping[str, Path], role: Role, stranger: str) -> dict[str, str]:
    """Who plays one side, by name: whom training went on from, a stranger to it, and the agents of each seed."""
    base = config.pursuer if role == Role.PURSUER else config.evader
    if base is None or config.self_play.disturbance == NONE:
        raise InvalidInput("--config must be a self-play that goes on from two agents, with [self_play.disturbance].")
    return {base: base, stranger: stranger} | {name: str(agent_file(run, AGENTS[role])) for name, run in runs.items()}


def meetings(
    folder: Path, game: Game, pursuers: Mapping[str, str], evaders: Mapping[str, str], games: int, seed: int
) -> dict[tuple[str, str], Meeting]:
    """Everyone against everyone, but that agents of different seeds do not meet."""
    own = set(pursuers) & set(evaders)
    return {
        (name, other): Meeting(folder / f"{name}--{other}.json", game, pursuer, evader, games, seed)
        for name, pursuer in pursuers.items()
        for other, evader in evaders.items()
        if name == other or not {name, other} <= own
    }


def main(arguments: list[str] | None = None) -> int:
    """Train, play, write the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--config", type=Path, default=Path("examples/robust.toml"), help="the self-play")
    parser.add_argument("--out", type=Path, default=Path("runs/robust"), help="folder of the runs")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--pursuer", default="P_pool", help="a pursuer that training does not know")
    parser.add_argument("--evader", default="E_curriculum", help="an evader that training does not know")
    parser.add_argument("--games", type=int, default=1000, help="games in each match")
    parser.add_argument("--seed", type=int, default=0, help="seed of the starts")
    add_workers(parser)
    options = parser.parse_args(arguments)
    require(options.seeds >= 1, "--seeds", options.seeds, "at least 1")
    require(options.games >= 1, "--games", options.games, "at least 1")
    require(options.config.is_file(), "--config", options.config, "a .toml file; check the path")
    out = options.out.absolute()
    cores = chosen_cores(options.processes, out)
    config = load_config(options.config)
    Physics(config.game, Drive())  # what cannot be simulated is refused before it is trained for
    runs = {f"seed-{seed}": out / f"seed-{seed}" for seed in range(options.seeds)}
    pursuers = entrants(config, runs, Role.PURSUER, options.pursuer)
    evaders = entrants(config, runs, Role.EVADER, options.evader)
    wanted = {run: (replace(config, seed=seed), tuple(AGENTS.values())) for seed, run in enumerate(runs.values())}
    if not train_runs(wanted, cores, print, options.on):
        return STOPPED
    matches = meetings(out / "matches", config.game, pursuers, evaders, options.games, options.seed)
    jobs = [Job(f"the match of {' and '.join(p)}", m.play, ()) for p, m in matches.items() if not m.file.exists()]
    if not run_jobs(jobs, cores, print, options.on):
        return STOPPED
    found: Comparisons = {pair: match.comparison() for pair, match in matches.items()}
    print(write_results(out, found, list(pursuers)[:2], list(evaders)[:2]))
    return 0


if __name__ == "__main__":
    sys.exit(exit_status(main))
