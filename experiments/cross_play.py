"""Do both sides beat their own past? Every pursuer kept during self-play against every evader kept.

    python experiments/cross_play.py runs/first --games 2000

prints the pursuer's win rates with Wilson 95 % intervals as a Markdown table: a row is a pursuer, a column an evader,
at 25, 50, 75 and 100 % of the stage. A pursuer that improves wins more further down; an evader that does lets it win
less further to the right.
"""

import argparse
from pathlib import Path

import apollonius

PERCENTAGES = (25, 50, 75, 100)


def agent_file(run: Path, side: str, percent: int) -> Path:
    """The agent of one side (`P` or `E`) kept at a percentage of self-play."""
    suffix = "" if percent == 100 else f"-{percent}"
    (path,) = [run / "agents" / f"{side}_{kind}{suffix}.safetensors" for kind in kinds(run)]
    return path


def kinds(run: Path) -> list[str]:
    """How the run's agents are called: `curriculum` or `scratch`."""
    return [path.stem.removeprefix("E_") for path in (run / "agents").glob("E_*.safetensors") if "-" not in path.stem]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path, help="folder of a training run with self-play")
    parser.add_argument("--games", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()

    game = apollonius.make_game("paper")
    print("| pursuer \\ evader | " + " | ".join(f"{percent} %" for percent in PERCENTAGES) + " |")
    print("|---" * (len(PERCENTAGES) + 1) + "|")
    for own in PERCENTAGES:
        pursuer = apollonius.find_agent(str(agent_file(options.run, "P", own)), apollonius.Role.PURSUER)
        cells = []
        for other in PERCENTAGES:
            evader = apollonius.find_agent(str(agent_file(options.run, "E", other)), apollonius.Role.EVADER)
            result = apollonius.play_match(game, pursuer.policy, evader.policy, options.games, options.seed)
            low, high = result.pursuer_win_interval
            cells.append(f"{result.pursuer_win_rate:.1%} [{low:.1%}, {high:.1%}]")
        print(f"| {own} % | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
