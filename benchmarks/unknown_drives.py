"""Robots of unknown drives and limits: `python benchmarks/unknown_drives.py OUT`.

Each game draws, for both robots, a lag of 0 to 5 steps, a turn time of 0 to 0.9 s, and limits
within 25 % of those that the game names. `identifying` players learn them while they drive;
`knowing` ones know them; `ignorant` ones take the named limits and an instant drive for the truth.
A side's own failures count those after the first 2 s.
"""

import argparse
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from apollonius.agents.policy import AbstractPolicy, AbstractWrapper, Memory
from apollonius.agents.source import NamedPlayer
from apollonius.arenas.charting import with_chart
from apollonius.arenas.file import find_game
from apollonius.catalogue import find_player
from apollonius.evaluate.match import Match, play_games
from apollonius.evaluate.statistics import wilson_interval
from apollonius.game.drive import Drive, Drives
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.outcome import EVADER_FAILS, PURSUER_FAILS
from apollonius.game.presets import randomised
from apollonius.game.scenario import Spread
from apollonius.game.types import Action, BySide, Outcome, RandomBits, Role
from apollonius.observe.drive_estimate import LIMITS
from apollonius.observe.view import View

LEARNING = 20
"""Steps that are not counted."""
GAMES = "paper", "office", "suite-v3/held-out"
SIDES = ("pursuer", "evader")


class Ignorant(AbstractWrapper[AbstractPolicy]):
    """Another player, which takes the named limits and an instant drive for the truth."""

    nominal: Unicycle

    def __call__(self, view: View, memory: Memory, bits: RandomBits) -> tuple[Action, Memory]:
        body = replace(self.nominal, radius=view.own.body.radius)
        own = replace(
            view.own, body=body, predicted_state=None, turn_time=None, turn_rate=None, command=None
        )
        observation = self.policy.observation(replace(view, own=own))
        return self.policy(observation, memory, bits)


def with_unknown_drives(game: Game) -> Game:
    """Return a game that draws drives and limits for each game."""
    spreads = list[Spread]()
    for side in SIDES:
        body = getattr(game, side)
        spreads.append(Spread((f"drives.{side}.lag",), 0, 5))
        spreads.append(Spread((f"drives.{side}.turn_time",), 0.0, 0.9))
        for limit in ("v_max", "u1_max", "u2_max"):
            named = float(getattr(body, limit))
            spread = (1 - LIMITS) * named, (1 + LIMITS) * named
            spreads.append(Spread((f"{side}.{limit}",), *spread))
    drives = Drives(Drive(lag=0, turn_time=0.0), Drive(lag=0, turn_time=0.0))
    return with_chart(randomised(replace(game, drives=drives), spreads))


def player_of(kind: str, bare: str, role: Role, game: Game) -> NamedPlayer:
    """Return a player that knows, ignores or learns its drive."""
    if kind == "identifying":
        return find_player(f"identifying:{bare}", role, game)
    player = find_player(bare, role, game)
    if kind == "knowing":
        return player
    return NamedPlayer(f"ignorant: {bare}", Ignorant(player.policy, game.bodies[role][0]))


def main() -> None:
    """Play, and write the counts of each game, pair and way."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("--games", type=int, default=1000)
    parser.add_argument("--max-steps", type=int, default=600)
    parser.add_argument("--in-games", nargs="+", default=GAMES)
    parser.add_argument(
        "--pairs", nargs="+", default=["pursuer evader", "shielded:pursuer shielded:evader"]
    )
    parser.add_argument("--kinds", nargs="+", default=["identifying", "knowing", "ignorant"])
    options = parser.parse_args()
    record: dict[str, Any] = {}
    for name in options.in_games:
        rules = replace(find_game(name), max_steps=options.max_steps)
        game = with_unknown_drives(rules)
        for pair in options.pairs:
            for kind in options.kinds:
                names = BySide(*pair.split())
                players = BySide(
                    player_of(kind, names.pursuer, Role.PURSUER, game),
                    player_of(kind, names.evader, Role.EVADER, game),
                )
                results = play_games(Match(game, players, options.games, seed=0))
                counts = count(np.asarray(results.outcome), np.asarray(results.steps))
                record[f"{name}: {kind} {pair}"] = counts
                print(name, kind, pair, counts, flush=True)
                options.out.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


def count(outcomes: np.ndarray, steps: np.ndarray) -> dict[str, Any]:
    """Return the counts of outcomes, and of the own failures of each side after 2 s."""
    counts: dict[str, Any] = {
        Outcome(int(outcome)).name.lower(): int(np.sum(outcomes == outcome))
        for outcome in np.unique(outcomes)
    }
    late = steps > LEARNING
    for side, kinds in (("pursuer", PURSUER_FAILS), ("evader", EVADER_FAILS)):
        failed = int(np.sum(np.isin(outcomes, [*kinds, Outcome.BOTH_FAILED]) & late))
        low, high = wilson_interval(failed, int(late.sum()))
        counts[f"{side}'s own failures after 2 s"] = failed
        counts[f"{side}'s, 95 %"] = [round(low, 4), round(high, 4)]
    counts["games of over 2 s"] = int(late.sum())
    return counts


if __name__ == "__main__":
    main()
