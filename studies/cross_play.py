"""Do both sides beat their own past? Every pursuer kept during self-play against every evader kept.

    python -m studies.cross_play runs/first --games 2000

prints the pursuer's win rates with Wilson 95 % intervals as a Markdown table: a row is a pursuer, a column an evader,
evenly spaced over the stage. A pursuer that improves wins more further down; an evader that does lets it win
less further to the right. `all` is the sum of a row or a column.
"""

import argparse
from pathlib import Path

from apollonius.catalogue import find_player
from apollonius.evaluate.match import Match, play_match
from apollonius.evaluate.statistics import wilson_interval
from apollonius.game.presets import make_game
from apollonius.game.types import Role
from apollonius.learn.folder import agent_file, load_config
from apollonius.show.markdown import markdown_head, markdown_row


def kind_of(run: Path) -> str:
    """How the run's agents are called: `curriculum` or `scratch`."""
    (kind,) = [
        path.stem.removeprefix("E_") for path in (run / "agents").glob("E_*.safetensors") if "-" not in path.stem
    ]
    return kind


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path, help="folder of a training run with self-play")
    parser.add_argument("--games", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()

    game, kind = make_game("paper"), kind_of(options.run)
    kept = load_config(options.run / "config.toml").self_play.snapshot_percents
    columns = [*[f"{percent} %" for percent in kept], "all"]
    print(markdown_head(["pursuer \\ evader", *columns]))
    in_column = [0] * len(kept)
    for own in kept:
        pursuer = find_player(str(agent_file(options.run, f"P_{kind}", own)), Role.PURSUER)
        wins = []
        for other in kept:
            evader = find_player(str(agent_file(options.run, f"E_{kind}", other)), Role.EVADER)
            result = play_match(Match(game, pursuer, evader, options.games, options.seed))
            wins.append(round(result.pursuer_win_rate * options.games))
        print(row(f"{own} %", wins, options.games), flush=True)
        in_column = [total + won for total, won in zip(in_column, wins, strict=True)]
    print(row("all", in_column, options.games * len(kept)))


def row(name: str, wins: list[int], games: int) -> str:
    """A row of the table: wins out of so many games each, and out of all of them."""
    counts = [*[(won, games) for won in wins], (sum(wins), games * len(wins))]
    cells = [
        f"{won / of:.1%} [{low:.1%}, {high:.1%}]" for won, of in counts for low, high in [wilson_interval(won, of)]
    ]
    return markdown_row([name, *cells])


if __name__ == "__main__":
    main()
