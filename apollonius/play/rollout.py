"""Batched play of two sides: the waist of the hourglass, used by training and by judging.

`collect` plays for a number of steps and starts finished games again; `apollonius.play.playout` plays given starts to
their ends, once each.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray, UInt32

from apollonius.agents.policy import Memory, mixed
from apollonius.agents.pool import AbstractPlayers, Pool, Read
from apollonius.game.drive import drive_of, respond
from apollonius.game.game import Game
from apollonius.game.types import ROLES, Action, Actions, BySide, DriveStates, GameState, Role, Scalar, Timestep, choose
from apollonius.observe import tracking
from apollonius.observe.observation import WHOLE, perceive
from apollonius.observe.tracking import Sightings, Track, update
from apollonius.play.autoreset import turn_of
from apollonius.play.random_bits import fold_in, random_bits

Pay = Callable[[GameState, Timestep], BySide[tuple[Scalar, ...]]]
"""The rewards of all robots by the state before a step and by the step, without a batch."""


class Experience(eqx.Module):
    """One side's part of a batch of transitions; leaves have the axes of the batch and, in teams, one of robots.

    `episode_return` is the sum of its rewards since the game began, this step included. `member`, without an axis of
    robots, is the player of the side's pool, the same in all transitions of a game. Observations of players that read
    the view itself are empty. In teams `active` is whether a robot was in play before the step, `lost` whether the step
    put it out.
    """

    observation: Float[Array, "*rows size"]
    action: Int[Array, "*rows"] | Float[Array, "*rows 2"]
    reward: Float[Array, "*rows"]
    next_observation: Float[Array, "*rows next"]
    episode_return: Float[Array, "*rows"]
    member: Int[Array, "*batch"]
    active: Bool[Array, "*rows"] | None = None
    lost: Bool[Array, "*rows"] | None = None


class Transition(eqx.Module):
    """A batch of transitions. `next_observation` is what the step led to, also where the game then ended."""

    sides: BySide[Experience]
    outcome: Int[Array, "*batch"]
    terminated: Bool[Array, "*batch"]
    truncated: Bool[Array, "*batch"]

    @property
    def ended(self) -> Bool[Array, "*batch"]:
        return self.terminated | self.truncated


class SideState(eqx.Module):
    """What one side of each game carries from start to end.

    Team mates are the same member. `episode_return` has an axis of robots in teams only, leaves of `memory` always.
    `track` is what a side with sensors knows, `drives` those of its robots.
    """

    member: Int[Array, " games"]
    episode_return: Float[Array, "games *robots"]
    memory: Memory = ()
    track: Track | None = None
    drives: DriveStates = ()


class Games(eqx.Module):
    """A batch of games under way."""

    state: GameState
    sides: BySide[SideState]

    @property
    def sightings(self) -> BySide[Sightings | None]:
        """The sightings of each side so far; None of one without sensors."""
        return self.sides.map(lambda side: side.track and side.track.sightings)


def begin(game: Game, starts: GameState, players: BySide[AbstractPlayers], bits: UInt32[Array, "2 games"]) -> Games:
    """Return games at their starts, with members drawn from both pools by the upper half of random bits."""

    def side(role: Role) -> SideState:
        own, robots = bits[role], len(starts.robots[role])
        first = jax.tree.map(
            lambda leaf: jnp.broadcast_to(leaf, (len(own), robots, *jnp.shape(leaf))), players[role].memory
        )
        returns = of_robots([jnp.zeros(own.shape, jnp.float32)] * robots)
        believes = players[role].observation == WHOLE  # no numbers are made of a belief
        track = jax.vmap(lambda state: tracking.begin(game, state, role, believes))(starts)
        drives = jax.vmap(lambda state: drives_at_start(game, state, role))(starts)
        return SideState(players[role].sample(own), returns, first, track, drives)

    return Games(starts, ROLES.map(side))


def drives_at_start(game: Game, state: GameState, role: Role) -> DriveStates:
    """Return the drives of a side's robots before the first step."""
    return (drive_of(game.at(state).drives, role).begin(),) * len(state.robots[role])


def of_robots(values: Sequence[Array]) -> Array:
    """Return the value of a side's robot in each game or, of a team, those of its robots along a second axis."""
    return values[0] if len(values) == 1 else jnp.stack(values, axis=1)


def look_around(
    game: Game, players: BySide[AbstractPlayers], games: Games, bits: UInt32[Array, "2 games"]
) -> tuple[BySide[Track | None], BySide[tuple[Read, Any]]]:
    """Return what both sides know after a look, by random bits of each, and what `perceive` makes of it."""

    def known(role: Role) -> tuple[Track | None, GameState]:
        side = games.sides[role]
        track, states = jax.vmap(partial(update, game, role))(side.track, games.state, bits[role])
        return track, jax.vmap(lambda state, drives: replace(state, drives=drives))(states, side.drives)

    both = ROLES.map(known)
    seen = ROLES.map(lambda role: perceive(players[role].observation, game, both[role][1], role))
    return both.map(lambda one: one[0]), seen


def step_games(
    game: Game,
    players: BySide[AbstractPlayers],
    games: Games,
    bits: UInt32[Array, "2 games"],
    observes: bool = True,
    foresees: bool = True,
    pay: Pay | None = None,
) -> tuple[Games, Transition]:
    """Play every game one step on, by fresh random bits of each side, without resets.

    Where nobody `observes` transitions have no observations, which take long to trace, where nobody `foresees` none of
    what they led to. Rewards are those of the game, unless a function pays.
    """
    tracks, seen = look_around(game, players, games, bits)
    acted = ROLES.map(lambda role: decide(players[role], games.sides[role], seen[role], bits[role]))
    actions = acted.map(lambda side: side[0])
    drives = games.sides.map(lambda side: side.drives)
    after, drives = jax.vmap(step_driven, in_axes=(None, 0, 0, 0))(game, games.state, drives, actions)
    rewards = (after.rewards if pay is None else jax.vmap(pay)(games.state, after)).map(of_robots)

    def side_after(role: Role) -> SideState:
        before = games.sides[role]
        returns = before.episode_return + rewards[role]
        return SideState(before.member, returns, acted[role][1], tracks[role], drives[role])

    played = Games(after.state, ROLES.map(side_after))
    next_seen = look_around(game, players, played, ~bits)[1] if observes and foresees else seen

    def numbers(role: Role, seen: Any, wanted: bool) -> Float[Array, "games *robots _"]:
        nothing = [jnp.zeros((bits.shape[1], 0))] * len(actions[role])
        whole = players[role].observation == WHOLE
        return of_robots(nothing if whole or not wanted else jnp.split(seen[1], len(actions[role])))

    def experience(role: Role) -> Experience:
        observations = numbers(role, seen[role], observes), numbers(role, next_seen[role], observes and foresees)
        returned = played.sides[role].episode_return
        made = observations[0], of_robots(actions[role]), rewards[role], observations[1], returned
        if games.state.status is None:
            return Experience(*made, games.sides[role].member)
        active, stays = (of_robots(state.active[role]) for state in (games.state, after.state))
        return Experience(*made, games.sides[role].member, active, active & ~stays)

    transition = Transition(ROLES.map(experience), after.outcome, after.terminated, after.truncated)
    return played, transition


def step_driven(
    game: Game, state: GameState, drives: BySide[DriveStates], actions: BySide[tuple[Action, ...]]
) -> tuple[Timestep, BySide[DriveStates]]:
    """Let all robots hold for a step what their drives make of their actions; return the drives after it, too."""
    limits, bodies = game.at(state).drives, game.at(state).bodies
    made = ROLES.map(lambda role: respond(drive_of(limits, role), drives[role], bodies[role], actions[role], game.dt))
    return game.step_controls(state, made.map(lambda one: one[0])), made.map(lambda one: one[1])


def decide(
    players: AbstractPlayers, side: SideState, seen: tuple[Read, Any], bits: UInt32[Array, " games"]
) -> tuple[tuple[Actions, ...], Memory]:
    """Return the actions of a side's robots in many games, who see what `perceive` returned, and their next memory."""
    read, rows = seen
    robots = side.episode_return[0].size
    memory = jax.tree.map(lambda leaf: jnp.swapaxes(leaf, 0, 1).reshape(-1, *leaf.shape[2:]), side.memory)
    each_its_own = jnp.concatenate([bits, *(mixed(bits, jnp.uint32(mate)) for mate in range(1, robots))])
    given, member = (rows, memory, each_its_own), jnp.tile(side.member, robots)
    if isinstance(players, Pool) or robots == 1:
        actions, after = players.act(member, read, *given)
        actions = tuple(jnp.split(actions, robots))
    else:  # the opponent depends on the game's place in the batch
        each = [jax.tree.map(lambda leaf, part=part: jnp.split(leaf, robots)[part], given) for part in range(robots)]
        acted = [players.act(side.member, read, *own) for own in each]
        actions = tuple(action for action, _ in acted)
        after = jax.tree.map(lambda *leaves: jnp.concatenate(leaves), *(memory for _, memory in acted))
    return actions, jax.tree.map(lambda leaf: jnp.swapaxes(leaf.reshape(robots, -1, *leaf.shape[1:]), 0, 1), after)


def collect(
    game: Game,
    players: BySide[AbstractPlayers],
    games: Games,
    starts: GameState,
    key: PRNGKeyArray,
    steps: int,
    foresees: bool = True,
) -> tuple[Games, Transition]:
    """Play on for a number of steps; a finished game begins again, with newly drawn members of both pools. The key is
    consumed. Returns the games after them, and the transitions, leaves `[steps, games]`, as `step_games`.

    A game that finishes at step t takes its own column of row `t % rows` of the starts, leaves `[rows, games]`, as in
    `apollonius.play.autoreset`.
    """
    batch = len(games.state.steps)
    kinds = 2 if any(pool.samples for pool in players) else 1  # new members that are alone share the actions' bits

    def one_step(games: Games, step: Int[Array, ""]) -> tuple[Games, Transition]:
        bits = random_bits(fold_in(key, step), (2 * kinds, batch))
        after, transition = step_games(game, players, games, bits[:2], foresees=foresees)
        fresh = begin(game, turn_of(starts, step), players, bits[-2:])
        return jax.vmap(choose)(transition.ended, fresh, after), transition

    return jax.lax.scan(one_step, games, jnp.arange(steps))
