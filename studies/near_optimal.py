"""Which starts a near-optimal evader still loses, whether the solved game loses them too, and why it survives the rest.

    apollonius solve game --role evader --grid 25x25x5x8 --out evader.npz
    python -m studies.near_optimal evader.npz --games 1000

plays an evader and the player by the table from the same starts against every trained pursuer that ships with the
package, and draws three pictures: the starts that are lost, the barrier, a chase round a disc.
"""

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import pairwise
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from apollonius.agents.kind import Named
from apollonius.agents.trained import TRAINED
from apollonius.catalogue import find_player
from apollonius.errors import exit_status
from apollonius.evaluate.match import Match, begin, play_games, replay_game
from apollonius.evaluate.statistics import wilson_interval
from apollonius.game.by_side import BySide
from apollonius.game.game import Game
from apollonius.game.outcome import PURSUER_WINS
from apollonius.game.presets import make_game
from apollonius.game.types import GameState, Outcome, Role
from apollonius.replay import Trajectory
from apollonius.reproduce.finding import Finding
from apollonius.show.markdown import markdown_table
from apollonius.show.survival import LostStarts, save_survival
from apollonius.solve.players import SaddlePolicy
from apollonius.solve.solved import table_player
from studies import driver

_CONCEDES = (0.0, 0.1, 0.2, 0.3, 0.4, 1.0)
"""Bounds between which starts are counted by what the solved game concedes there."""
_LAP_SECONDS = 16.0
"""Length of the chase that is drawn [s]."""
_NEAR_DISC = 2.0
"""How near its centre a robot goes round a disc, at most [m]."""

Lost = Bool[np.ndarray, " games"]


@dataclass(frozen=True, kw_only=True)
class NearOptimal(driver.AbstractStudy):
    """An evader beside the player by the table."""

    name = "near_optimal"
    table: Path = driver.option(type=Path, help="the solved game from the evader's side (solve game)")
    agent: str = driver.option("E_optimal", help="the evader (default: %(default)s)")
    hunter: str = driver.option("P_optimal", help="who chases it round a disc (default: %(default)s)")
    games: int = driver.option(1000, help="games with each pursuer (default: %(default)s)")
    seed: int = driver.option(0, help="of the starts")

    @cached_property
    def game(self) -> Game:
        """The rules."""
        return make_game("paper")

    @cached_property
    def solved(self) -> SaddlePolicy:
        """The player by the table."""
        return table_player(self.table, self.game)

    def finding(self) -> Finding:
        """How many starts each loses, by what the solved game concedes there; and the pictures."""
        names = [name for name in TRAINED.names() if TRAINED.fits(name, Role.PURSUER, self.game)]
        agent = find_player(self.agent, Role.EVADER, self.game)
        players = {agent.name: agent, "table": Named("table", self.solved)}
        lost = {who: {name: self.lost(name, player) for name in names} for who, player in players.items()}
        starts = begin(self.match(names[0], agent))[0]
        concedes = -np.asarray(self.solved.best_value(starts))
        often = {who: np.sum([*by_name.values()], axis=0) for who, by_name in lost.items()}
        self.out.mkdir(parents=True, exist_ok=True)
        chase = f"{self.hunter} follows {agent.name} round a disc", self._lap(agent)
        counted = LostStarts(starts, often[agent.name], often["table"])
        save_survival(self.game, self.solved, agent.name, counted, chase, self.out / "near_optimal.png")
        tables = [_by_opponent(lost), _by_concession(concedes, often)]
        both = (often[agent.name] > 0) & (often["table"] > 0)
        said = (
            f"Of {self.games:,} starts {agent.name} loses {np.mean(often[agent.name] > 0):.1%} to at least one of "
            f"these pursuers, the table {np.mean(often['table'] > 0):.1%}; {np.mean(both):.1%} are lost by both."
        )
        data = {
            "games": self.games,
            "seed": self.seed,
            "lost": {who: {name: int(one.sum()) for name, one in by_name.items()} for who, by_name in lost.items()},
            "lost_to_one_at_least": {who: int((count > 0).sum()) for who, count in often.items()},
            "lost_by_both": int(both.sum()),
        }
        return Finding(
            "What a near-optimal evader loses", "\n\n".join([said, *tables]), ("near_optimal.png",), data=data
        )

    def match(self, pursuer: str, evader: Named) -> Match:
        """The games of the evader with one pursuer."""
        return Match(self.game, BySide(find_player(pursuer, Role.PURSUER, self.game), evader), self.games, self.seed)

    def lost(self, pursuer: str, evader: Named) -> Lost:
        """Which games the pursuer wins."""
        return np.isin(np.asarray(play_games(self.match(pursuer, evader)).outcome), PURSUER_WINS)

    def _lap(self, agent: Named) -> Trajectory:
        """The part of a game in which the evader goes farthest round a disc."""
        match = Match(self.game, BySide(find_player(self.hunter, Role.PURSUER, self.game), agent), 8, self.seed)
        steps = round(_LAP_SECONDS / float(self.game.dt))
        farthest, found = -1.0, None
        for index in range(match.games):
            course = replay_game(match, index)
            so_far = np.concatenate([[0.0], np.cumsum(_turned(self.game, course.states))])
            round_it = np.abs(so_far[steps:] - so_far[:-steps])
            if len(round_it) and round_it.max() > farthest:
                farthest, found = round_it.max(), (course, int(round_it.argmax()))
        assert found, "some game lasts longer than that"
        course, first = found
        states = jax.tree.map(lambda leaf: leaf[first : first + steps + 1], course.states)
        return Trajectory(states, course.actions[first : first + steps], jnp.asarray(Outcome.ONGOING, jnp.int32))


def _turned(game: Game, states: GameState) -> Float[np.ndarray, " steps"]:
    """By how much both robots together go round a disc in each step [rad]; 0 where one is not near the same disc."""
    most = np.zeros(len(states.steps) - 1)
    for disc in game.arena.discs:
        rounds, near = [], np.ones(len(states.steps) - 1, bool)
        for robot in (states.pursuer, states.evader):
            dx, dy = np.asarray(robot.x) - float(disc.x), np.asarray(robot.y) - float(disc.y)
            rounds.append(np.diff(np.unwrap(np.arctan2(dy, dx))))
            near &= np.hypot(dx, dy)[1:] < _NEAR_DISC
        most = np.where(near, sum(rounds), most)
    return most


def _by_opponent(lost: Mapping[str, Mapping[str, Lost]]) -> str:
    """A row for each pursuer."""

    def told(one: Lost) -> str:
        low, high = wilson_interval(int(one.sum()), len(one))
        return f"{one.mean():.1%} [{100 * low:.1f}, {100 * high:.1f}]"

    columns = [*lost]
    rows = [[name, *(told(lost[who][name]) for who in columns)] for name in lost[columns[0]]]
    return markdown_table(["lost to", *columns], rows)


def _by_concession(concedes: np.ndarray, often: Mapping[str, np.ndarray]) -> str:
    """A row for each range of what the solved game concedes."""
    rows = []
    for low, high in pairwise(_CONCEDES):
        here = (np.clip(concedes, 0.0, 0.999) >= low) & (np.clip(concedes, 0.0, 0.999) < high)
        shares = [f"{np.mean(count[here] > 0):.1%}" if here.any() else "-" for count in often.values()]
        rows.append([f"{low:g} to {high:g}", str(int(here.sum())), *shares])
    return markdown_table(["the solved game concedes", "starts", *(f"lost by {who}" for who in often)], rows)


main = partial(driver.main, NearOptimal)

if __name__ == "__main__":
    sys.exit(exit_status(main))
