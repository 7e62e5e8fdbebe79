"""The ladder of outside agents: all pairings with the package's agents and rules, ratings, and who
beats whom.

    python -m benchmarks.entrants.ladder FOLDER --out FILE --plot FILE

FOLDER has the agents that `benchmarks.entrants.train` made. A challenger, given by `--pursuers` or
`--evaders` as a name or a file, plays them all.
"""

import argparse
import re
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from importlib.metadata import version
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from apollonius import BySide, MatchResult, Role, find_player, load_agent
from apollonius.agents.source import NamedPlayer
from apollonius.evaluate.statistics import predict
from apollonius.evaluate.tournament import Tournament, play_tournament
from apollonius.game.types import ROLES
from apollonius.io.document import to_json, write_atomically
from apollonius.show import palette, style
from benchmarks.entrants.game import ENV_STEPS, GAME, HIDDEN, OPPONENTS

OURS = BySide(
    ("pursuer", "P_curriculum", "P_random", "shielded:intercept", "intercept", "random"),
    ("evader", "E_curriculum", "flee-aware", "flee", "still", "random"),
)
"""The package's agents, and the rules."""
SCORE = BySide("wins against ours", "undefeated against ours")
"""The share by which a side is ranked: of games against the same opponents for all."""
FILE = re.compile(r"(?P<learner>.+)-(?P<side>pursuer|evader)-(?P<seed>\d+)")
OWN_FAILURES = BySide(
    ("pursuer_hit_obstacle", "pursuer_out_of_range"), ("evader_hit_obstacle", "evader_out_of_range")
)


def learner_of(name: str) -> str:
    """Return the learner that a player is a training of, or the player's own name."""
    named = FILE.fullmatch(name)
    return named["learner"] if named else name


def pool_results(results: Sequence[MatchResult]) -> MatchResult:
    """Return the counts of several matches as those of one."""
    outcomes = {
        name: sum(result.outcomes[name] for result in results) for name in results[0].outcomes
    }
    mean_steps = float(np.mean([result.mean_steps for result in results]))
    return MatchResult(outcomes, mean_steps, None)


def pool_trainings(tournament: Tournament) -> Tournament:
    """Return a tournament whose players are entrants: the trainings of each count as one."""
    pursuers = groups_of(tournament.pursuers)
    evaders = groups_of(tournament.evaders)
    rows = tuple(
        tuple(
            pool_results([tournament.matches[row][column] for row in rows for column in columns])
            for columns in evaders.values()
        )
        for rows in pursuers.values()
    )
    return Tournament((*pursuers,), (*evaders,), rows)


def groups_of(names: Sequence[str]) -> dict[str, list[int]]:
    """Return the numbers of the trainings of each learner."""
    groups: dict[str, list[int]] = {}
    for number, name in enumerate(names):
        groups.setdefault(learner_of(name), []).append(number)
    return groups


def shares_of(tournament: Tournament, role: Role) -> dict[str, Float[np.ndarray, " players"]]:
    """Return shares of the games of each player of a side, means over opponents.

    `undefeated` is of the games that it did not lose; `own failures`, `captures` and `time-outs`
    are of the games against `OURS`.
    """
    rows, opponents = tournament.matches, tournament.evaders
    if role is Role.EVADER:
        rows, opponents = tuple(zip(*rows, strict=True)), tournament.pursuers
    everyone = range(len(opponents))
    panel = [number for number in everyone if opponents[number] in OURS[role.other]]

    def share(
        count: Callable[[MatchResult], int], columns: Sequence[int]
    ) -> Float[np.ndarray, " players"]:
        shares = [[count(row[column]) / row[column].games for column in columns] for row in rows]
        return np.mean(shares, axis=1)

    counts = BySide(attrgetter("pursuer_wins"), attrgetter("evader_wins"))
    return {
        "wins against ours": share(counts[role], panel),
        "undefeated against ours": 1 - share(counts[role.other], panel),
        "undefeated": 1 - share(counts[role.other], everyone),
        "own failures": share(
            lambda match: sum(match.outcomes[name] for name in OWN_FAILURES[role]), panel
        ),
        "captures": share(lambda match: match.outcomes["captured"], panel),
        "time-outs": share(lambda match: match.outcomes["no_result"], panel),
    }


def standings(tournament: Tournament, role: Role) -> dict[str, dict[str, Any]]:
    """Return for each learner of a side its Elo points and shares: the mean of its trainings, with
    the 95 % interval of a further training, and each training's own.
    """
    names = tournament.pursuers if role is Role.PURSUER else tournament.evaders
    shares = shares_of(tournament, role)
    columns = {"elo": tournament.ratings[role].points} | shares
    rows: dict[str, dict[str, Any]] = {}
    for learner, numbers in groups_of(names).items():
        rows[learner] = {}
        for column, values in columns.items():
            own = values[numbers]
            digits = 0 if column == "elo" else 4
            row: dict[str, Any] = {"mean": round(float(own.mean()), digits)}
            if len(own) > 1:
                bounds = (-np.inf, np.inf) if column == "elo" else (0.0, 1.0)
                interval = predict(own[:, None], *bounds).interval
                row["next"] = [round(end, digits) for end in interval]
                row["trainings"] = [round(value, digits) for value in own.tolist()]
            rows[learner][column] = row
    return dict(sorted(rows.items(), key=lambda row: -row[1][SCORE[role]]["mean"]))


def trainings_in(folder: Path) -> dict[str, dict[str, Any]]:
    """Return the library of each learner and the processor seconds of its trainings."""
    learners: dict[str, dict[str, Any]] = {}
    for path in sorted(folder.glob("*.safetensors")):
        named = FILE.fullmatch(path.stem)
        if named:
            training = load_agent(path).header.training
            blank = {"library": training["library"], "pursuer": [], "evader": []}
            row = learners.setdefault(named["learner"], blank)
            row[named["side"]].append(training["processor seconds"])
    return learners


def play(
    folder: Path, challengers: BySide[Sequence[str]], games: int, seed: int
) -> tuple[Tournament, float]:
    """Play all pairings; return them and the processor seconds that they took."""

    def side(role: Role) -> list[NamedPlayer]:
        files = sorted(folder.glob(f"*-{role.name.lower()}-*.safetensors"))
        trainings = [replace(find_player(str(path), role, GAME), name=path.stem) for path in files]
        names = (*OURS[role], *challengers[role])
        return [*trainings, *(find_player(name, role, GAME) for name in names)]

    last = time.monotonic()

    def report(played: int, total: int) -> None:
        nonlocal last
        if time.monotonic() > last + 10:
            last = time.monotonic()
            print(f"{played:,} of {total:,} games", flush=True)

    start = time.process_time()
    tournament = play_tournament(GAME, ROLES.map(side), games, seed, report=report)
    return tournament, time.process_time() - start


def draw(result: dict[str, Any], path: Path) -> None:
    """Save the pursuers' win rates [%], a row each, both sides in the order of the ladder."""
    sides = BySide("pursuer", "evader").map(lambda side: [*result["ladder"][side]])
    rows = [result["pursuers"].index(name) for name in sides.pursuer]
    columns = [result["evaders"].index(name) for name in sides.evader]
    rates = 100 * np.array(result["pursuer's win rates"])[np.ix_(rows, columns)]
    with style.picture(path, width=6.4, height=5.4) as (axes,):
        axes.imshow(rates, cmap="RdBu_r", vmin=0, vmax=100, aspect="auto")
        axes.set_xticks(range(len(columns)), sides.evader, rotation=45, ha="right")
        axes.set_yticks(range(len(rows)), sides.pursuer)
        axes.grid(visible=False)
        for (row, column), rate in np.ndenumerate(rates):
            colour = "white" if abs(rate - 50) > 35 else palette.INK
            axes.text(column, row, f"{rate:.0f}", ha="center", va="center", color=colour)
        title = "games that the pursuer wins [%]; the best players are first"
        axes.set(title=title, xlabel="evader", ylabel="pursuer")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--pursuers", nargs="+", default=[], help="challengers")
    parser.add_argument("--evaders", nargs="+", default=[], help="challengers")
    parser.add_argument("--games", type=int, default=100, help="(default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="(default: %(default)s)")
    parser.add_argument("--out", type=Path, help="the ladder as JSON")
    parser.add_argument("--plot", type=Path, help="who beats whom as PNG")
    options = parser.parse_args()
    challengers = BySide(options.pursuers, options.evaders)
    tournament, seconds = play(options.folder, challengers, options.games, options.seed)
    pooled = pool_trainings(tournament)
    ladder = {role.name.lower(): standings(tournament, role) for role in Role}
    for side, rows in ladder.items():
        for learner, row in rows.items():
            shares = [f"{name} {row[name]['mean']:.1%}" for name in row if name != "elo"]
            print(f"{side} {learner}: {row['elo']['mean']:.0f}, {', '.join(shares)}")
    result = {
        "date": f"{datetime.now(UTC):%Y-%m-%d}",
        "command": "python -m benchmarks.entrants.ladder FOLDER",
        "versions": {name: version(name) for name in ("apollonius", "jax")},
        "budget": {
            "env steps": ENV_STEPS,
            "hidden": HIDDEN,
            "opponents": {role.name.lower(): OPPONENTS[role] for role in Role},
        },
        "learners": trainings_in(options.folder),
        "games of a match": options.games,
        "seed": options.seed,
        "processor seconds of the matches": round(seconds),
        "ladder": ladder,
        "pursuers": pooled.pursuers,
        "evaders": pooled.evaders,
        "pursuer's win rates": [
            [round(rate, 3) for rate in row] for row in pooled.win_rates.tolist()
        ],
    }
    if options.out:
        write_atomically(options.out, f"{to_json(result, indent=1)}\n".encode())
    if options.plot:
        draw(result, options.plot)


if __name__ == "__main__":
    main()
