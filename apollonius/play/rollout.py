"""Batched play of two sides: the waist of the hourglass, used by training and by judging.

`collect` plays for a number of steps and starts finished games again; `apollonius.play.playout`
plays given starts to their ends, once each.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray, UInt32

from apollonius.accelerate.bit_mixing import mix_bits
from apollonius.accelerate.threefry import threefry_bits
from apollonius.agents.policy import Memory
from apollonius.agents.pool import AbstractPlayers, Pool, Reader
from apollonius.game.drive import drive_of, respond
from apollonius.game.game import Game
from apollonius.game.types import (
    ROLES,
    Action,
    Actions,
    BySide,
    Controls,
    DriveStates,
    GameState,
    Role,
    Scalar,
    Timestep,
    tree_where,
)
from apollonius.observe import tracking
from apollonius.observe.knowledge import Knowledge
from apollonius.observe.observation import RAW_VIEW, observation_rows
from apollonius.observe.tracking import Sightings, Track, sense_and_update
from apollonius.play.autoreset import row_at_turn

Pay = Callable[[GameState, Timestep], BySide[tuple[Scalar, ...]]]
"""The rewards of all robots by the state before a step and by the step, without a batch."""


class Experience(eqx.Module):
    """One side's part of a batch of transitions; leaves have the axes of the batch and, in teams,
    one of robots.

    `episode_return` is the sum of its rewards since the game began, this step included. `member`,
    without an axis of robots, is the player of the side's pool, the same in all transitions of a
    game. Observations of players that read the view itself are empty. `active` is whether a robot
    was in play before the step, `lost` whether the step put it out.
    """

    observation: Float[Array, "*rows size"]
    action: Int[Array, "*rows"] | Float[Array, "*rows 2"]
    reward: Float[Array, "*rows"]
    next_observation: Float[Array, "*rows next"]
    episode_return: Float[Array, "*rows"]
    member: Int[Array, "*batch"]
    active: Bool[Array, "*rows"]
    lost: Bool[Array, "*rows"]


class Transition(eqx.Module):
    """A batch of transitions. `next_observation` is what the step led to, also where the game then
    ended.
    """

    sides: BySide[Experience]
    outcome: Int[Array, "*batch"]
    terminated: Bool[Array, "*batch"]
    truncated: Bool[Array, "*batch"]

    @property
    def ended(self) -> Bool[Array, "*batch"]:
        return self.terminated | self.truncated


class SideState(eqx.Module):
    """State that one side of each game carries from start to end.

    Team mates are the same member. `episode_return` has an axis of robots in teams only, leaves of
    `memory` always. `track` is what a side with sensors knows, `drives` those of its robots.
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


def init_games(
    game: Game, starts: GameState, players: BySide[AbstractPlayers], bits: UInt32[Array, "2 games"]
) -> Games:
    """Return games at their starts, with members drawn from both pools.

    Args:
        game: the rules.
        starts: initial states, leaves `[games]`.
        players: the players of both sides.
        bits: random bits, of which the upper half draws the members.
    """

    def side(role: Role) -> SideState:
        side_bits, robots = bits[role], len(starts.robots[role])
        memory = jax.tree.map(
            lambda leaf: jnp.broadcast_to(leaf, (len(side_bits), robots, *jnp.shape(leaf))),
            players[role].memory,
        )
        returns = stack_robots([jnp.zeros(side_bits.shape, jnp.float32)] * robots)
        reads_view = players[role].observation == RAW_VIEW  # no numbers are made of a belief
        track = jax.vmap(lambda state: tracking.init_track(game, state, role, reads_view))(starts)
        drives = jax.vmap(lambda state: drives_at_start(game, state, role))(starts)
        return SideState(players[role].sample(side_bits), returns, memory, track, drives)

    return Games(starts, ROLES.map(side))


def drives_at_start(game: Game, state: GameState, role: Role) -> DriveStates:
    """Return the drives of a side's robots before the first step."""
    return (drive_of(game.at(state).drives, role).at_rest(),) * len(state.robots[role])


def stack_robots(values: Sequence[Array]) -> Array:
    """Stack the values of a side's robots along a second axis; one robot's value stays as it is."""
    return values[0] if len(values) == 1 else jnp.stack(values, axis=1)


def observe_both(
    game: Game, players: BySide[AbstractPlayers], games: Games, bits: UInt32[Array, "2 games"]
) -> tuple[BySide[Track | None], BySide[tuple[Reader, Any]]]:
    """Let both sides sense; return their tracks, and their perceptions as `observation_rows` gives
    them.

    Args:
        game: the rules.
        players: the players of both sides.
        games: the games under way.
        bits: random bits of each side.
    """

    def track_and_knowledge(role: Role) -> tuple[Track | None, Knowledge]:
        side, sense = games.sides[role], partial(sense_and_update, game, role)
        return jax.vmap(sense)(side.track, games.state, bits[role], side.drives)

    tracks_and_knowledge = ROLES.map(track_and_knowledge)

    def perception(role: Role) -> tuple[Reader, Any]:
        knowledge = tracks_and_knowledge[role][1]
        return observation_rows(players[role].observation, game, knowledge, role)

    return tracks_and_knowledge.map(lambda pair: pair[0]), ROLES.map(perception)


def step_games(
    game: Game,
    players: BySide[AbstractPlayers],
    games: Games,
    bits: UInt32[Array, "2 games"],
    with_obs: bool = True,
    with_next_obs: bool = True,
    pay: Pay | None = None,
) -> tuple[Games, Transition]:
    """Play every game one step, without resets.

    Args:
        game: the rules.
        players: the players of both sides.
        games: the games under way.
        bits: fresh random bits of each side.
        with_obs: False leaves the transitions' observations empty, which saves tracing time.
        with_next_obs: False leaves their next observations empty.
        pay: the rewards, if not those of the game.
    """
    with_next_obs = with_obs and with_next_obs
    tracks, perceptions = observe_both(game, players, games, bits)
    choices = ROLES.map(
        lambda role: decide_actions(players[role], games.sides[role], perceptions[role], bits[role])
    )
    actions = choices.map(lambda side: side[0])
    drives_before = games.sides.map(lambda side: side.drives)
    step_all = jax.vmap(step_driven, in_axes=(None, 0, 0, 0))
    after, drives = step_all(game, games.state, drives_before, actions)
    paid = after.rewards if pay is None else jax.vmap(pay)(games.state, after)
    rewards = paid.map(stack_robots)

    def side_after(role: Role) -> SideState:
        before = games.sides[role]
        returns = before.episode_return + rewards[role]
        return SideState(before.member, returns, choices[role][1], tracks[role], drives[role])

    games_after = Games(after.state, ROLES.map(side_after))
    next_perceptions = perceptions
    if with_next_obs:
        _, next_perceptions = observe_both(game, players, games_after, ~bits)

    def experience(role: Role) -> Experience:
        numbers = partial(_numbers, players[role], (bits.shape[1], len(actions[role])))
        observation = numbers(perceptions[role], with_obs)
        next_observation = numbers(next_perceptions[role], with_next_obs)
        observations = observation, next_observation
        return _experience(role, games, games_after, actions[role], rewards[role], observations)

    transition = Transition(ROLES.map(experience), after.outcome, after.terminated, after.truncated)
    return games_after, transition


def _numbers(
    players: AbstractPlayers,
    shape: tuple[int, int],
    perception: tuple[Reader, Any],
    is_stored: bool,
) -> Float[Array, "games *robots numbers"]:
    """Return the observations of a side's robots as a transition stores them.

    Args:
        players: the side's players; those that read the view itself have no numbers.
        shape: the numbers of games and of robots.
        perception: the side's own, as `observe_both` gives it.
        is_stored: False leaves the observations empty.
    """
    games, robots = shape
    if players.observation == RAW_VIEW or not is_stored:
        return stack_robots([jnp.zeros((games, 0))] * robots)
    _, rows = perception
    return stack_robots(jnp.split(rows, robots))


def _experience(
    role: Role,
    before: Games,
    after: Games,
    actions: tuple[Actions, ...],
    rewards: Float[Array, "games *robots"],
    observations: tuple[Array, Array],
) -> Experience:
    """Return one side's part of a batch of transitions.

    Args:
        role: the side.
        before, after: the games before and after the step.
        actions: the actions of each robot.
        rewards: the rewards of the step.
        observations: the observations before and after the step.
    """
    active = stack_robots(before.state.in_play[role])
    observation, next_observation = observations
    return Experience(
        observation=observation,
        action=stack_robots(actions),
        reward=rewards,
        next_observation=next_observation,
        episode_return=after.sides[role].episode_return,
        member=before.sides[role].member,
        active=active,
        lost=active & ~stack_robots(after.state.active[role]),
    )


def step_driven(
    game: Game, state: GameState, drives: BySide[DriveStates], actions: BySide[tuple[Action, ...]]
) -> tuple[Timestep, BySide[DriveStates]]:
    """Play one step through the robots' drives; return the drives after it, too.

    Args:
        game: the rules.
        state: the state before the step.
        drives: the drives of all robots.
        actions: the action of every robot.
    """
    limits, bodies = game.at(state).drives, game.at(state).bodies

    def respond_all(role: Role) -> tuple[tuple[Controls, ...], DriveStates]:
        drive = drive_of(limits, role)
        return respond(drive, drives[role], bodies[role], actions[role], game.dt)

    responses = ROLES.map(respond_all)
    controls = responses.map(lambda response: response[0])
    drives_after = responses.map(lambda response: response[1])
    return game.step_controls(state, controls), drives_after


def decide_actions(
    players: AbstractPlayers,
    side: SideState,
    observed: tuple[Reader, Any],
    bits: UInt32[Array, " games"],
) -> tuple[tuple[Actions, ...], Memory]:
    """Return the actions of a side's robots in many games, and their next memory.

    Players act on rows `[robots * games]`, the games of the first robot first; memories are stored
    as `[games, robots, ...]`.

    Args:
        players: the side's players.
        side: the side's state, leaves `[games, ...]`.
        observed: the side's perception, as `observe_both` gives it.
        bits: random bits of each game.
    """
    read, rows = observed
    robots = side.episode_return[0].size

    def as_rows(leaf: Array) -> Array:
        return jnp.swapaxes(leaf, 0, 1).reshape(-1, *leaf.shape[2:])

    def as_games(leaf: Array) -> Array:
        return jnp.swapaxes(leaf.reshape(robots, -1, *leaf.shape[1:]), 0, 1)

    memory = jax.tree.map(as_rows, side.memory)
    mate_bits = [mix_bits(bits, jnp.uint32(mate)) for mate in range(1, robots)]
    robot_bits = jnp.concatenate([bits, *mate_bits])
    arguments, member = (rows, memory, robot_bits), jnp.tile(side.member, robots)
    if isinstance(players, Pool) or robots == 1:
        actions, after = players.act(member, read, *arguments)
        actions = tuple(jnp.split(actions, robots))
    else:  # the opponent depends on the game's place in the batch
        parts = [
            jax.tree.map(lambda leaf, robot=robot: jnp.split(leaf, robots)[robot], arguments)
            for robot in range(robots)
        ]
        results = [players.act(side.member, read, *part_arguments) for part_arguments in parts]
        actions = tuple(action for action, _ in results)
        after = jax.tree.map(
            lambda *leaves: jnp.concatenate(leaves), *(memory for _, memory in results)
        )
    return actions, jax.tree.map(as_games, after)


def collect(
    game: Game,
    players: BySide[AbstractPlayers],
    games: Games,
    starts: GameState,
    key: PRNGKeyArray,
    steps: int,
    with_next_obs: bool = True,
) -> tuple[Games, Transition]:
    """Play on for some steps; finished games begin again with newly drawn members of both pools.

    Returns the games after the steps, and the transitions, leaves `[steps, games]`.

    Args:
        game: the rules.
        players: the players of both sides.
        games: the games under way.
        starts: initial states, leaves `[rows, games]`. A game that finishes at step t takes its own
            column of row `t % rows`, as in `apollonius.play.autoreset`.
        key: draws all random bits; it is consumed.
        steps: number of steps.
        with_next_obs: as in `step_games`.
    """
    batch = len(games.state.steps)
    # Pools of one member draw none, so that no bits are needed besides those of the actions.
    kinds = 2 if any(pool.samples for pool in players) else 1

    def one_step(games: Games, step: Int[Array, ""]) -> tuple[Games, Transition]:
        bits = threefry_bits(jax.random.fold_in(key, step), (2 * kinds, batch))
        after, transition = step_games(game, players, games, bits[:2], with_next_obs=with_next_obs)
        fresh = init_games(game, row_at_turn(starts, step), players, bits[-2:])
        return jax.vmap(tree_where)(transition.ended, fresh, after), transition

    return jax.lax.scan(one_step, games, jnp.arange(steps))
