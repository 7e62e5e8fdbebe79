"""What a planner that knows an agent takes from each agent of the ladder.

    python -m benchmarks.entrants.planner FOLDER --out FILE

Each training is one agent, and all have the same starts. Some ten processor seconds an agent.
"""

import argparse
from pathlib import Path
from typing import Any

from apollonius import BySide, Match, NamedPlayer, Role, find_player
from apollonius.arenas.charting import with_chart
from apollonius.evaluate.match import play_games
from apollonius.exploit.attack import losses_of
from apollonius.exploit.attackers import planner_against
from apollonius.io.document import to_json, write_atomically
from benchmarks.entrants.game import GAME
from benchmarks.entrants.ladder import OURS, learner_of

GAMES, SEED = 20, 0


def measure(folder: Path) -> dict[str, dict[str, list[dict[str, float]]]]:
    """Return the losses to the planner and the own failures among them, by side and learner."""
    game = with_chart(GAME)
    table: dict[str, dict[str, list[dict[str, float]]]] = {}
    for role in Role:
        side = role.name.lower()
        names = [*map(str, sorted(folder.glob(f"*-{side}-*.safetensors"))), *OURS[role]]
        rows = table[side] = {}
        for name in names:
            agent = find_player(name, role, game)
            planner = NamedPlayer("planner", planner_against(agent, role, game))
            match = Match(game, BySide.of(role, agent, planner), GAMES, SEED)
            losses = losses_of(game, role, play_games(match, slots=GAMES))
            learner = learner_of(Path(name).stem)
            rows.setdefault(learner, []).append({"loses": losses.loses, "fails": losses.fails})
            print(side, learner, losses, flush=True)
    return table


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path, required=True, help="the losses as JSON")
    options = parser.parse_args()
    result: dict[str, Any] = {"games": GAMES, "seed": SEED, "planner": measure(options.folder)}
    write_atomically(options.out, f"{to_json(result, indent=1)}\n".encode())


if __name__ == "__main__":
    main()
