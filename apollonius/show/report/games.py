"""The games that a report shows: one for every way in which a pairing's games end, lost ones first."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from apollonius.errors import require
from apollonius.evaluate.match import Match, play_games, record_game, worst_first
from apollonius.replay import Replay, as_data
from apollonius.show.parts import in_play

GAMES = 200
"""Games of each pairing among which those that are shown are found."""
SEED = 1
LONGEST = 50_000
"""Most steps of such a game; the paper's have 1,000 at most."""
ORDER = (
    "one for every way in which they end, those that the pursuer lost first; beside each how long it lasts, and "
    "how many of the games end so."
)
"""Which they are, in words."""
_DIGITS = 3
"""Decimals of the states in the page: a millimetre, which is less than a pixel."""


@dataclass(frozen=True)
class Shown:
    """A game to watch."""

    replay: Replay
    times: int
    """How many games of this pairing ended in this way."""

    @property
    def pairing(self) -> str:
        return f"{self.replay.pursuer} against {self.replay.evader}"

    @property
    def outcome(self) -> str:
        return self.replay.outcome.name.lower()

    @property
    def seconds(self) -> float:
        """How long it lasted [s]."""
        return len(self.replay.actions) * float(self.replay.game.dt)

    def to_dict(self) -> dict[str, Any]:
        """The game as the page's script reads it: a replay file without the actions, states rounded.

        Of a game of teams `until` says for each robot the first step at which it is out of play, or None.
        """
        data = as_data(self.replay) | {"states": self.replay.states.astype(float).round(_DIGITS).tolist()}
        del data["actions"]
        if self.replay.game.teams:
            steps = in_play(self.replay.game, self.replay).sum(axis=0).tolist()
            data["until"] = [step if step < len(self.replay.states) else None for step in steps]
        return data


def games_to_show(match: Match) -> list[Shown]:
    """Return one game for each outcome that occurs in a match, in the order of `worst_first`.

    Raises:
        InvalidInput: when its games may last for more than `LONGEST` steps.
    """
    bound = f"at most {LONGEST:,}, or no page could hold them"
    require(match.game.max_steps <= LONGEST, "steps of a game that a report shows", match.game.max_steps, bound)
    results = play_games(match)
    outcomes = np.asarray(results.outcome)
    first: dict[int, int] = {}
    for index in worst_first(results):
        first.setdefault(int(outcomes[index]), index)
    return [Shown(record_game(match, index), int(np.sum(outcomes == outcome))) for outcome, index in first.items()]
