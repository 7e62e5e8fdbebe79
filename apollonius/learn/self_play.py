"""Algorithm 2: both sides learn, against each other and, by a scheme, against earlier versions of
the other side.
"""

import functools
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import equinox as eqx
import jax
from jaxtyping import PRNGKeyArray

from apollonius.agents.network import Network
from apollonius.agents.pool import Pool
from apollonius.game.game import Game
from apollonius.game.types import ROLES, BySide, GameState, Role
from apollonius.io.errors import require, require_positive, require_within
from apollonius.io.limits import require_memory
from apollonius.learn.algorithm import Algorithm
from apollonius.learn.earlier_versions import (
    SCHEMES,
    EarlierVersions,
    add_version,
    draw_version,
    init_versions,
    learner_and_earlier,
    record_results,
)
from apollonius.learn.rollout_stage import RolloutStage
from apollonius.learn.stage import (
    NO_NETWORKS,
    Metrics,
    StageConfig,
    TrainState,
    end_iteration,
    zero_counters,
)


@dataclass(frozen=True)
class SelfPlayConfig(StageConfig):
    """Stage 2. Its pursuer has learned already and explores little; progress weighs little.

    With c = 3 an evader that gains three metres on its way into a wall is paid more than it loses
    there.
    """

    kind: Literal["self-play"] = "self-play"
    env_steps: int = 90_000_000
    pursuer_epsilon: float = 0.2
    progress: float = 1.0
    snapshots: int = 4
    opponents: str = "latest"
    """`latest`: each other, as in Algorithm 2. Others: an earlier version in a share of the games
    (`apollonius.learn.earlier_versions.SCHEMES`).
    """
    past_share: float = 0.5
    """Share of the games with an earlier version, of one side or of both, unless the scheme is
    `latest`.
    """
    versions: int = 16
    """Earlier versions kept of each side, taken evenly over the stage."""
    renewal: int = 524_288
    """Env steps between two draws of versions, in which a game can last to its time limit."""

    def __post_init__(self) -> None:
        super().__post_init__()
        schemes = f"one of {', '.join(SCHEMES)}"
        require(self.opponents in SCHEMES, "opponents", self.opponents, schemes)
        require_positive(self, "versions", "renewal", "past_share")
        require_within(self, 0, 1, "past_share")

    @property
    def has_earlier_versions(self) -> bool:
        """True if some games are played with earlier versions."""
        return self.opponents != "latest"

    def agent_kind(self, is_first: bool) -> str:
        return "scratch" if is_first else "curriculum"

    def check(self, algorithm: Algorithm, game: Game) -> None:
        """Refuse earlier versions that memory or the time between two draws does not suffice
        for, too.
        """
        super().check(algorithm, game)
        if not self.has_earlier_versions:
            return
        needed = 2 * self.versions * 4 * algorithm.depth * algorithm.width**2
        require_memory("versions", self.versions, needed, "keep fewer, or train a smaller network")
        longest = algorithm.games * (self.time_limit or game.max_steps)
        bound = f"at least games x max_steps = {longest:,}, so that games end between two draws"
        require(self.renewal >= longest, "renewal", self.renewal, bound)

    def make(self, algorithm: Algorithm, game: Game, folder: Path | None = None) -> "SelfPlay":
        return SelfPlay(self, algorithm, self.game_of_training(game), game)

    def chunks_per_draw(self, algorithm: Algorithm) -> int:
        """Count the compiled calls between two draws of versions."""
        return -(-self.renewal // algorithm.env_steps_per_chunk)


class SelfPlayState(TrainState):
    """State of self-play: besides both sides their earlier versions; None where the scheme has
    none.
    """

    earlier: BySide[EarlierVersions] | None = None


class SelfPlay(RolloutStage):
    """Stage 2 in its game."""

    config: SelfPlayConfig = eqx.field(static=True)
    algorithm: Algorithm = eqx.field(static=True)
    game: Game
    evaluation_game: Game

    def init(
        self, key: PRNGKeyArray, networks: BySide[Network | None] = NO_NETWORKS
    ) -> SelfPlayState:
        *network_keys, stage_key = jax.random.split(key, 3)
        start_key, member_key, train_key = jax.random.split(stage_key, 3)
        # Algorithm 2, lines 1 to 4: replay buffers; Q_p as loaded, Q_e of random weights; targets.
        learners = {role: self.init_side(role, network_keys[role], networks[role]) for role in Role}
        earlier = None
        if self.config.has_earlier_versions:
            first = ROLES.map(lambda role: learners[role].learner.network)
            earlier = first.map(lambda network: init_versions(network, self.config.versions))
        state = SelfPlayState(None, learners, train_key, **zero_counters(), earlier=earlier)
        return self.begin_games(state, start_key, member_key)

    def players(self, state: SelfPlayState) -> BySide[Pool]:
        """Return both learners, or each with its earlier versions."""
        if state.earlier is None:
            return ROLES.map(lambda role: self.explorer(state, role))
        earlier = state.earlier

        def of_side(role: Role) -> Pool:
            explorer = self.explorer_policy(state, role)
            # Each side draws by itself.
            share = 1 - (1 - self.config.past_share) ** (1 / len(Role))
            pool = learner_and_earlier(explorer, self.algorithm.frozen, earlier[role], share)
            return replace(pool, bits=self.noise(state, role))

        return ROLES.map(of_side)

    def step(self, state: SelfPlayState) -> tuple[SelfPlayState, Metrics]:
        """Train one chunk, as every stage does; before it, versions are drawn where that is due."""
        if state.earlier is not None:
            chunk = int(state.iterations) // self.algorithm.iterations_per_chunk
            if chunk > 0 and chunk % self.config.chunks_per_draw(self.algorithm) == 0:
                state = draw_versions(self, state)
        return super().step(state)

    def iterate(self, state: SelfPlayState, starts: GameState) -> tuple[SelfPlayState, Metrics]:
        play_key, *learn_keys = jax.random.split(state.iteration_key(1), 3)
        # Algorithm 2, lines 5 to 8: actions are executed; games that are over begin again.
        games, played = self.play(state, starts, play_key)
        env_steps = state.env_steps + self.algorithm.env_steps_per_iteration
        # Algorithm 2, line 9: transitions are stored. Lines 10 to 12: mini-batches, updates,
        # targets.
        learners = {
            role: self.learn(state, role, played, env_steps, learn_keys[role]) for role in Role
        }
        after, metrics = end_iteration(state, games, played, env_steps, learners)
        if state.earlier is None:
            return after, metrics
        earlier = state.earlier
        counted = ROLES.map(lambda role: record_results(earlier[role], role, played))
        return replace(after, earlier=counted), metrics

    @property
    def opponents(self) -> None:
        return None


@functools.partial(jax.jit, donate_argnames="state")
def draw_versions(stage: SelfPlay, state: SelfPlayState) -> SelfPlayState:
    """Add both learners to their earlier versions where that is due, and draw the versions that new
    games meet. The state is consumed.
    """
    config, algorithm, earlier = stage.config, stage.algorithm, state.earlier
    assert earlier is not None
    interval = max(1, config.env_steps // config.versions)
    since_last_draw = config.chunks_per_draw(algorithm) * algorithm.env_steps_per_chunk
    is_due = state.env_steps // interval > (state.env_steps - since_last_draw) // interval
    keys = jax.random.split(state.iteration_key(2), len(Role))

    def of_side(role: Role) -> EarlierVersions:
        more = add_version(earlier[role], state.learners[role].learner.average, is_due)
        return draw_version(more, config.opponents, keys[role])

    return replace(state, earlier=ROLES.map(of_side))
