"""Algorithm 1: a pursuer learns to catch evaders that do not learn."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import equinox as eqx
import jax
from jaxtyping import PRNGKeyArray

from apollonius.agents.network import Network
from apollonius.agents.pool import AbstractPlayers, Pool
from apollonius.arenas.charting import with_chart
from apollonius.catalogue import find_pool
from apollonius.game.game import Game
from apollonius.game.types import BySide, GameState, Role
from apollonius.learn.algorithm import Algorithm
from apollonius.learn.rollout_stage import RolloutStage
from apollonius.learn.stage import (
    NO_NETWORKS,
    Metrics,
    StageConfig,
    TrainState,
    end_iteration,
    zero_counters,
)

_STILL = ("still",)


@dataclass(frozen=True)
class FixedTargetConfig(StageConfig):
    """Stage 1: the pursuer against evaders that do not learn."""

    keeps_best = True
    kind: Literal["fixed-target"] = "fixed-target"
    evaders: tuple[str, ...] = _STILL
    """Players that the pursuer learns to catch: `still`, as in Algorithm 1, or others, of whom each
    game meets one.
    """

    @property
    def roles(self) -> tuple[Role, ...]:
        return (Role.PURSUER,)

    @property
    def opponent_names(self) -> tuple[str, ...]:
        return self.evaders

    def agent_kind(self, is_first: bool) -> str:
        if self.evaders == _STILL:
            return "stage1"
        return Path(self.evaders[0]).stem if len(self.evaders) == 1 else "pool"

    def require_players(self, game: Game) -> None:
        find_pool(self.evaders, Role.EVADER, game)

    def make(self, algorithm: Algorithm, game: Game, folder: Path | None = None) -> "FixedTarget":
        evaders = find_pool(self.evaders, Role.EVADER, game)
        charted = with_chart(game, evaders.members.needs_chart)
        return FixedTarget(self, algorithm, self.game_of_training(charted), charted, evaders)


class FixedTarget(RolloutStage):
    """Stage 1 in its game, with the evaders."""

    config: FixedTargetConfig = eqx.field(static=True)
    algorithm: Algorithm = eqx.field(static=True)
    game: Game
    evaluation_game: Game
    evaders: Pool

    def init(self, key: PRNGKeyArray, networks: BySide[Network | None] = NO_NETWORKS) -> TrainState:
        network_key, stage_key = jax.random.split(key)
        start_key, member_key, train_key = jax.random.split(stage_key, 3)
        # Algorithm 1, lines 1 to 3: the replay buffer, Q_p, its target.
        pursuer = self.init_side(Role.PURSUER, network_key, networks.pursuer)
        state = TrainState(None, {Role.PURSUER: pursuer}, train_key, **zero_counters())
        return self.begin_games(state, start_key, member_key)

    def players(self, state: TrainState) -> BySide[AbstractPlayers]:
        return BySide(self.explorer(state, Role.PURSUER), self.evaders)

    def iterate(self, state: TrainState, starts: GameState) -> tuple[TrainState, Metrics]:
        play_key, learn_key = jax.random.split(state.iteration_key(1))
        # Algorithm 1, lines 4 to 7: actions are executed; games that are over begin again.
        games, played = self.play(state, starts, play_key)
        env_steps = state.env_steps + self.algorithm.env_steps_per_iteration
        # Algorithm 1, line 8: transitions are stored. Lines 9 to 11: mini-batch, update, target.
        pursuer_and_loss = self.learn(state, Role.PURSUER, played, env_steps, learn_key)
        return end_iteration(state, games, played, env_steps, {Role.PURSUER: pursuer_and_loss})

    @property
    def opponents(self) -> Pool:
        return self.evaders

    def is_better(self, outcomes: dict[str, int], best: dict[str, int] | None) -> bool:
        """Check whether a pursuer is the best so far.

        Against an evader that stays that is the one with most captures (section IV), otherwise the
        latest: the one with most wins would be one that waits until a random evader has failed.
        """
        if self.config.evaders != _STILL or best is None:
            return True
        return outcomes["captured"] > best["captured"]
