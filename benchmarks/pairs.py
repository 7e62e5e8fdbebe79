"""Whether two pursuers that flank catch more than two that do not: `python benchmarks/pairs.py OUT`
plays each pair on the same starts, in games in which cooperation must pay: 60 s, loops that the
evader runs round.

`alone:` is the same network blind to its mates. OUT is read first, so that a stopped run is
continued.
"""

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from jaxtyping import Array, Bool, Float

from apollonius.agents.policy import AbstractActionValuePolicy, AbstractValueWrapper, Memory
from apollonius.agents.source import NamedPlayer
from apollonius.arenas.file import find_game
from apollonius.catalogue import find_player
from apollonius.evaluate.match import Match, play_games
from apollonius.evaluate.statistics import paired_difference_interval
from apollonius.game.game import Game
from apollonius.game.outcome import EVADER_FAILS, PURSUER_WINS
from apollonius.game.types import BySide, Outcome, RandomBits, Role
from apollonius.observe.view import View

GAMES = tuple(
    f"team-2v1/examples/games/{name}.toml" for name in ("ring_road", "two_blocks", "fast_evader")
)
"""Games in which cooperation must pay. Pilots had shown that pairs lose in the first two; the third
was named before a game of it was played.
"""
FLANKING, TEAM, ALONE = "flanking:pursuer", "pursuer", "alone:pursuer"
SLOTS = 20
"""Games that are played at once."""


class Alone(AbstractValueWrapper):
    """Another pursuer, blind to its mates."""

    def score(
        self, view: View, memory: Memory, bits: RandomBits
    ) -> tuple[Float[Array, "9"], Memory]:
        return self.score_view(replace(view, mates=()), memory, bits)


def find_pursuer(name: str, game: Game) -> NamedPlayer:
    """Return the pursuer of a name, which may begin with `alone:`."""
    if not name.startswith("alone:"):
        return find_player(name, Role.PURSUER, game)
    inner = find_player(name.removeprefix("alone:"), Role.PURSUER, game).policy
    assert isinstance(inner, AbstractActionValuePolicy)
    return NamedPlayer(name, Alone(inner))


def play(game_name: str, pursuer: str, evader: str, games: int, seed: int) -> dict[str, Any]:
    """Play the games of a pair; a letter of `captured` for each, 1 for a capture."""
    game = find_game(game_name)
    players = BySide(find_pursuer(pursuer, game), find_player(evader, Role.EVADER, game))
    start = process_time()

    def report(done: int, total: int) -> None:
        print(f"\r{game_name} {pursuer}: {done} of {total}", end="", file=sys.stderr, flush=True)

    match = Match(game, players, games, seed)
    results = play_games(match, slots=min(games, SLOTS), report=report)
    outcome, steps = np.asarray(results.outcome), np.asarray(results.steps)
    is_capture = outcome == Outcome.CAPTURED
    is_failure = ~np.isin(outcome, PURSUER_WINS) & (outcome != Outcome.NO_RESULT)
    return {
        "captures": int(is_capture.sum()),
        "evader_failed": int(np.isin(outcome, EVADER_FAILS).sum()),
        "pursuers_failed": int(is_failure.sum()),
        "mean_seconds": round(float(np.mean(steps[is_capture]) * game.dt), 1),
        "captured": "".join(map(str, is_capture.astype(int))),
        "processor_seconds": round(process_time() - start),
    }


def captures(result: dict[str, Any]) -> Bool[np.ndarray, " games"]:
    """Return the games of a result that ended with a capture, as a mask."""
    return np.array([letter == "1" for letter in result["captured"]])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--games", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--evader", default="evader")
    parser.add_argument("--game", nargs="+", default=GAMES)
    parser.add_argument("--pursuers", nargs="+", default=(TEAM, ALONE, FLANKING))
    options = parser.parse_args()
    text = options.out.read_text(encoding="utf-8") if options.out.exists() else "{}"
    table = json.loads(text)
    for game_name in options.game:
        key = f"{game_name} {options.evader} {options.games} {options.seed}"
        results = table.setdefault(key, {})
        for name in options.pursuers:
            if name not in results:
                results[name] = play(game_name, name, options.evader, options.games, options.seed)
                text = json.dumps(table, indent=1) + "\n"
                options.out.write_text(text, encoding="utf-8")
            facts = {fact: value for fact, value in results[name].items() if fact != "captured"}
            print(key, name, facts, flush=True)
        for name in results:
            if name != FLANKING and FLANKING in results:
                pair = captures(results[FLANKING]), captures(results[name])
                low, high = paired_difference_interval(*pair)
                print(f"{key}: {FLANKING} - {name}: {100 * low:.1f} to {100 * high:.1f} points")


if __name__ == "__main__":
    main()
