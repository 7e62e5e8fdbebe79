"""Compiled functions that pickle, and many games that one side plays from outside."""

import functools
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from apollonius.agents.policy import AbstractPolicy, Memory
from apollonius.agents.pool import Pool
from apollonius.game.game import Game
from apollonius.game.types import (
    ROLES,
    Action,
    BySide,
    DriveStates,
    GameState,
    RandomBits,
    Role,
    tree_where,
)
from apollonius.io.errors import InvalidInput
from apollonius.observe.observation import AbstractObservation
from apollonius.observe.tracking import Track
from apollonius.play.rollout import (
    Games,
    Pay,
    SideState,
    init_games,
    observe_both,
    stack_robots,
    step_games,
)

SPARE = 4
"""Starts are sampled in advance, for this many times the number of games."""
_TOGETHER = 512
"""Starts that are sampled together until all are possible: with more, more samples would be in
vain.
"""


class CompiledFunction:
    """A function of a module, compiled with its first arguments as constants; what is pickled
    compiles for itself.
    """

    def __init__(self, function: Callable[..., Any], *constants: Any) -> None:
        self._function = function
        self._constants = constants
        self._compiled = jax.jit(functools.partial(function, *constants))

    def __call__(self, *arguments: Any) -> Any:
        return self._compiled(*arguments)

    def __reduce__(self) -> tuple[type["CompiledFunction"], tuple[Any, ...]]:
        return CompiledFunction, (self._function, *self._constants)

    def __deepcopy__(self, memo: dict[int, Any]) -> "CompiledFunction":
        return self  # nothing of it ever changes


_PROCESS = os.getpid()


def require_unforked() -> None:
    """Refuse, by InvalidInput, to compute in a process that was forked after this module was
    imported.
    """
    if os.getpid() != _PROCESS:
        raise InvalidInput(
            "JAX cannot compute in a forked process: start it by spawning, as "
            "gymnasium.vector.AsyncVectorEnv does with context='spawn', or take gymnasium.make_vec."
        )


class ExternalPolicy(AbstractPolicy):
    """A player whose actions come from outside: each is put into its memory, at first any action,
    before the step.
    """

    first: Action
    reads: AbstractObservation = eqx.field(static=True)

    @property
    def observation(self) -> AbstractObservation:
        return self.reads

    @property
    def memory(self) -> Memory:
        return self.first

    def __call__(
        self, observation: Float[Array, " size"], memory: Memory, bits: RandomBits
    ) -> tuple[Action, Memory]:
        return memory, memory


def start_games(game: Game, players: BySide[Pool], state: GameState) -> Games:
    return init_games(game, state, players, jnp.zeros((2, len(state.steps)), jnp.uint32))


def _parts(games: Games, players: BySide[Pool]) -> BySide[tuple[Memory, Track | None, DriveStates]]:
    def parts_of_side(role: Role) -> tuple[Memory, Track | None, DriveStates]:
        side = games.sides[role]
        return (
            () if isinstance(players[role].members, ExternalPolicy) else side.memory,
            side.track,
            side.drives,
        )

    return ROLES.map(parts_of_side)


def flatten_carry(games: Games, players: BySide[Pool]) -> tuple[Array, ...]:
    """Return the arrays of games besides their states: memories of the package's players, tracks
    and drives.

    They are a flat tuple, as flattening a tree costs as much as a step.
    """
    return tuple(jax.tree.leaves(_parts(games, players)))


def restore_games(
    game: Game,
    players: BySide[Pool],
    state: GameState,
    carried: Sequence[Array],
    actions: BySide[Any],
) -> Games:
    """Rebuild games from their states and the arrays of `flatten_carry`.

    Args:
        game: The game.
        players: Both sides' players.
        state: The state of each game, `[games]`.
        carried: The arrays that `flatten_carry` returned.
        actions: Actions of a side from outside, `[games, robots]`.
    """
    games = start_games(game, players, state)
    parts = jax.tree.unflatten(jax.tree.structure(_parts(games, players)), carried)

    def side(role: Role) -> SideState:
        memory, track, drives = parts[role]
        acts = isinstance(players[role].members, ExternalPolicy)
        return replace(
            games.sides[role], memory=actions[role] if acts else memory, track=track, drives=drives
        )

    return replace(games, sides=ROLES.map(side))


class RunningGames(eqx.Module):
    """Games under way, the observations of the side from outside, and all else that games carry
    (`flatten_carry`).
    """

    state: GameState
    observation: Float[Array, "games *robots size"]
    carry: tuple[Array, ...]


class StepResult(eqx.Module):
    """Results of a step of every game, before any new game begins.

    `reward` is the mean of the robots' `rewards`; `status` is a `RobotStatus` for each robot.
    """

    observation: Float[Array, "games *robots size"]
    reward: Float[Array, " games"]
    terminated: Bool[Array, " games"]
    truncated: Bool[Array, " games"]
    outcome: Int[Array, " games"]
    rewards: Float[Array, "games robots"]
    status: Int[Array, "games robots"]


@dataclass(frozen=True)
class GameBatch:
    """Constants of many games, in which the player of side `role` is `ExternalPolicy`.

    With `next_step` a game that has ended begins again in the next step, else in the same one.
    `pay` is as for `step_games`.
    """

    game: Game
    role: Role
    players: BySide[Pool]
    num_envs: int
    next_step: bool
    pay: Pay | None = None

    def sample_starts(self, bits: RandomBits) -> RunningGames:
        keys = jax.random.split(jax.random.key(bits), SPARE * self.num_envs)
        starts: GameState = jax.lax.map(self.game.reset, keys, batch_size=_TOGETHER)
        games = start_games(self.game, self.players, starts)
        first_bits = jax.random.bits(keys[0], (len(keys),), jnp.uint32)
        _, observations_by_side = observe_both(
            self.game, self.players, games, jnp.stack([first_bits, first_bits])
        )
        observations = stack_robots(
            jnp.split(observations_by_side[self.role][1], len(self.game.bodies[self.role]))
        )
        return RunningGames(starts, observations, flatten_carry(games, self.players))

    def step(
        self,
        now: RunningGames,
        ended: Bool[Array, " games"],
        starts: RunningGames,
        used: Int[Array, ""],
        actions: Int[Array, "games *robots"] | Float[Array, "games *robots 2"],
        bits: RandomBits,
    ) -> tuple[RunningGames, StepResult]:
        """Step every game; return the games and their results.

        Args:
            now: The games.
            ended: Games that a new one replaces, with `next_step`.
            starts: Sampled starts of new games.
            used: Number of starts that were used.
            actions: Actions of the side from outside.
            bits: Random bits.
        """
        several = len(self.game.bodies[self.role]) > 1
        actions_by_side = BySide.of(self.role, actions if several else actions[:, None], None)
        games = restore_games(self.game, self.players, now.state, now.carry, actions_by_side)
        step_bits = jax.random.bits(jax.random.key(bits), (self.num_envs,), jnp.uint32)
        games, transitions = step_games(
            self.game, self.players, games, jnp.stack([step_bits, step_bits]), pay=self.pay
        )
        own_side = transitions.sides[self.role]
        rewards = jnp.unstack(own_side.reward, axis=1) if several else [own_side.reward]
        result = StepResult(
            own_side.next_observation,
            sum(rewards[1:], rewards[0]) / len(rewards),
            transitions.terminated,
            transitions.truncated,
            transitions.outcome,
            rewards=jnp.stack(rewards, 1),
            status=jnp.stack(games.state.status[self.role], 1),
        )
        new_games = RunningGames(
            games.state, result.observation, flatten_carry(games, self.players)
        )
        if not self.next_step:
            return auto_reset(new_games, starts, used, transitions.ended), result
        # Zeros: no reward, no end, an ongoing game, active robots.
        restarted = replace(jax.tree.map(jnp.zeros_like, result), observation=result.observation)
        return auto_reset(new_games, starts, used, ended), jax.vmap(tree_where)(
            ended, restarted, result
        )


def auto_reset(
    now: RunningGames, starts: RunningGames, used: Int[Array, ""], resets: Bool[Array, " games"]
) -> RunningGames:
    """Replace some games by new ones from the first unused starts.

    Args:
        now: The games.
        starts: Sampled starts.
        used: Number of starts that were used.
        resets: Games to replace.
    """
    place = jnp.where(resets, used + jnp.cumsum(resets.astype(jnp.int32)) - 1, 0)
    return jax.vmap(tree_where)(resets, jax.tree.map(lambda leaf: leaf[place], starts), now)
