"""A player as a function of arrays alone: what an exported policy computes, in every language."""

import functools
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Float32

from apollonius.agents.built_in import PLAYERS
from apollonius.agents.names import bare_name
from apollonius.agents.policy import AbstractPolicy, Memory
from apollonius.agents.trained import find_trained
from apollonius.arenas.charting import with_chart
from apollonius.arenas.file import from_dict
from apollonius.catalogue import find_player
from apollonius.game.drive import Drives, drive_of
from apollonius.game.game import Game
from apollonius.game.presets import make_game
from apollonius.game.sensing import Percept, Sensing
from apollonius.game.types import (
    NUM_ACTIONS,
    BySide,
    DriveState,
    GameState,
    MoverMotion,
    RandomBits,
    RobotState,
    RobotStatus,
    Role,
)
from apollonius.game.uncertainty import Uncertainties
from apollonius.io import extensions
from apollonius.io.errors import require
from apollonius.observe.knowledge import Knowledge
from apollonius.observe.registry import find_observation
from apollonius.observe.tracking import Track, apply_delay, knowledge_of, update_track
from apollonius.observe.tracking import init_track as known_first
from apollonius.observe.view import view_of

LARGEST = 1e6
"""Largest number of a state; the sum of squares is compared, one test that a NaN fails too."""


@dataclass(frozen=True)
class Player:
    """A player of one robot in games of one size, with the arena's chart if it reads one.

    The `policy` is what the package plays, its layers' weights transposed: `[in, out]`.
    """

    name: str
    role: Role
    game: Game
    package: AbstractPolicy
    policy: AbstractPolicy

    @property
    def robots(self) -> int:
        """Return the number of robots of both sides."""
        return sum(map(len, self.game.bodies))

    @property
    def movers(self) -> int:
        """Return the number of things that move by themselves."""
        return len(self.game.movers.bodies.radius) if self.game.movers else 0

    @property
    def largest(self) -> Float32[np.ndarray, "2"]:
        """Return the largest controls, u1 [m/s^2] and u2 [rad/s]; never 0."""
        body = self.game.bodies[self.role][0]
        return np.maximum(np.array([body.u1_max, body.u2_max], np.float32), 1e-6)

    @property
    def arguments(self) -> tuple[Any, ...]:
        """Return arguments of `decide`; those after the game, but the memory, are examples."""
        active = jnp.ones(self.robots, bool) if self.robots > 2 else None
        states = jnp.zeros((self.robots, 4), jnp.float32)
        movers = jnp.zeros((self.movers, 4), jnp.float32) if self.movers else None
        return self.policy, self.game, states, active, movers, self.memory, jnp.uint32(0)

    @property
    def memory(self) -> Memory:
        """The memory at the beginning of a game: the policy's; with sensors the track of opponents;
        with a drive its state at rest.
        """
        robots = self.game.bodies.map(lambda side: (RobotState(*jnp.zeros(4)),) * len(side))
        track = known_first(self.game, GameState.at_start(robots), self.role)
        if track is not None:
            track = replace(track, sightings=None)
        drive = drive_of(self.game.drives, self.role).at_rest()
        return pack_memory(track, drive, self.policy.memory)

    @property
    def decide(self) -> Callable[..., dict[str, Any]]:
        """Return the function that decides in one step.

        Args:
            player: `self.policy`.
            game: `self.game`.
            state: x [m], y [m], speed [m/s] and heading [rad] of every robot: its own, then its
                mates', then its opponents', `[robots, 4]`.
            active: Whether each robot is in play, `[robots]`; None for two robots.
            movers: x, y [m] and velocity x, y [m/s] of every mover, in the order of the rules:
                shuttles, doors, then walkers, `[movers, 4]`; None in a game without any.
            memory: The memory of the last step, or `self.memory` where a game begins.
            bits: 32 random bits.

        Returns:
            A dict of the `action` (`types.Action`), the `controls` u1 [m/s^2] and u2 [rad/s], and
            the `memory`. For a state with a NaN or a number beyond `LARGEST`, and for an action
            that is not finite, it is full braking straight ahead; with sensors an opponent or a
            mover of such a state is out of sight.
        """
        return _decide(self.role, self.game.bodies.map(len))


@functools.cache
def _decide(role: Role, sides: BySide[int]) -> Callable[..., dict[str, Any]]:
    def decide(
        player: AbstractPolicy,
        game: Game,
        state: Float[Array, "robots 4"],
        active: Bool[Array, " robots"] | None,
        movers: Float[Array, "movers 4"] | None,
        memory: Memory,
        bits: RandomBits,
    ) -> dict[str, Any]:
        policy = transpose_layers(player)
        knowledge, track, drive_state, own_memory = knowledge_and_memory(
            game, role, sides, state, active, movers, memory
        )
        observation = policy.observation(view_of(game, knowledge, role))
        action, own_memory = policy(observation, own_memory, bits)
        own_rows = state if track is None else state[: sides[role]]
        if track is None and movers is not None:
            own_rows = jnp.concatenate([own_rows, movers])
        is_sane = jnp.sum(own_rows * own_rows) <= LARGEST**2
        if policy.continuous:
            is_sane &= jnp.isfinite(action).all()
        body = game.bodies[role][0]
        level = body.braking_level(state[0, 2])
        brake = jnp.stack([level, jnp.zeros(())])
        if not policy.continuous:
            brake = jnp.int32(NUM_ACTIONS // 2) + 3 * level.astype(jnp.int32)
        action = jnp.where(is_sane, action, brake)
        controls = body.controls(action)
        drive = drive_of(game.drives, role)
        _, drive_state = drive.respond(drive_state, body, action, game.dt)
        memory = pack_memory(track, drive_state, own_memory)
        return {"action": action, "controls": jnp.stack(controls), "memory": memory}

    return decide


def pack_memory(track: Track | None, drive: DriveState, own: Memory) -> Memory:
    """Return an exported player's memory, which is its policy's if the others are empty."""
    return (track, drive, own) if jax.tree.leaves((track, drive)) else own


def knowledge_and_memory(
    game: Game,
    role: Role,
    sides: BySide[int],
    state: Array,
    active: Array | None,
    movers: Array | None,
    memory: Memory,
) -> tuple[Knowledge, Track | None, DriveState, Memory]:
    """Return a side's knowledge in this step, and the parts of its memory: track, drive, policy's
    memory.

    The robot's own drive is in the state that its commands lead to; those of its mates are taken to
    be at rest.

    Args:
        game: The game.
        role: The robot's side.
        sides: Numbers of robots.
        state: State of every robot, `[robots, 4]`, as in `Player.decide`.
        active: Whether each robot is in play, `[robots]`; None for two robots.
        movers: Of every mover, `[movers, 4]`, as in `Player.decide`; None in a game without any.
        memory: The memory of the last step.
    """
    sensors = game.sensors and game.sensors[role]
    drive = drive_of(game.drives, role)
    if sensors or jax.tree.leaves(drive):
        track, drive_state, own_memory = memory
    else:
        track = None
        drive_state = drive.at_rest()
        own_memory = memory
    drives = (drive_state, *[drive.at_rest()] * (sides[role] - 1))
    motion = None if movers is None else MoverMotion(*movers.T)
    if sensors is None or track is None:
        knowledge = Knowledge.complete(state_of(state, active, role, sides), drives)
        return replace(knowledge, movers=motion), None, drive_state, own_memory
    is_seen = _is_sane(state)
    current = state_of(jnp.where(is_seen[:, None], state, 0.0), active, role, sides)
    own = current.robots[role]
    percept = Percept(
        own, current.robots[role.other], tuple(is_seen[len(own) :]), jnp.ones((), bool)
    )
    pending, past = apply_delay(sensors, track.pending, percept)  # sightings are late already
    track = replace(track, own=own, pending=pending)
    track = update_track(game, track, replace(percept, own=past.own), current, role)
    knowledge = knowledge_of(game, track, current, role, drives)
    if movers is not None:
        knowledge = replace(knowledge, movers=motion, movers_in_sight=_is_sane(movers))
    return knowledge, track, drive_state, own_memory


def _is_sane(rows: Float[Array, "rows 4"]) -> Bool[Array, " rows"]:
    """Check that no number of a row is a NaN or beyond `LARGEST`."""
    return jnp.sum(rows * rows, axis=1) <= LARGEST**2


def exported_side(name: str, side: str | None = None) -> Role:
    """Return the side that a player plays, or the given one of a player of either; raises
    InvalidInput otherwise.
    """
    bare = bare_name(name)
    sides = _sides_of_rule(bare) or (Role[find_trained(bare)[0].header.role.upper()],)
    named = [side.name.lower() for side in sides]
    require(
        side is None or side in named, "side", side, f"{' or '.join(named)}, which '{name}' plays"
    )
    require(
        side or len(sides) == 1,
        "side",
        "missing",
        f"{' or '.join(named)}, as '{name}' plays either",
    )
    return Role[side.upper()] if side else sides[0]


def _sides_of_rule(name: str) -> tuple[Role, ...]:
    """Return the sides that a player which was not trained can play, either for one of another
    package; else none.
    """
    if name in PLAYERS:
        return PLAYERS[name][1]
    return (
        tuple(Role)
        if ":" in name and name in extensions.extension_names(extensions.PLAYERS)
        else ()
    )


def training_game(name: str) -> Game:
    """Return the game that a player was made for, `paper` for none; raises InvalidInput for one of
    any arena.
    """
    bare = bare_name(name)
    if _sides_of_rule(bare):
        return make_game("paper")
    header = find_trained(bare)[0].header
    bound = f"one arena, since '{name}' does not say what it was made for"
    require(header.game, "game", "missing", bound)
    has_one_arena = header.game.get("scenario") is None
    reads_chart = find_observation(header.observation).needs_chart
    bound = f"one arena, as office, since '{name}' plays in any"
    require(has_one_arena and not reads_chart, "game", "missing", bound)
    return from_dict(Game, header.game, f"'{name}'")


def find_exportable(name: str | AbstractPolicy, role: Role, game: Game) -> Player:
    """Return the player of this name, or a policy, to be exported.

    Raises:
        InvalidInput: As `find_player`; for games in several arenas; for networks with weights that
            are not finite; for
            a robot that does not come to rest by braking, the answer to a broken state.
    """
    game.require_one_arena("an exported policy")
    named_player = find_player(name, role, game)
    policy = named_player.policy
    finite = all(
        np.isfinite(leaf).all()
        for leaf in jax.tree.leaves(eqx.filter(policy, eqx.is_inexact_array))
    )
    require(finite, "weights", "NaN or infinite", "finite; train the agent again")
    body = game.bodies[role][0]
    limits = float(body.v_min), float(body.u1_max)
    bound = (
        "at most 0 m/s and more than 0 m/s^2, so that braking, the answer to a broken state, ends "
        "at rest"
    )
    require(body.brakes_to_rest, "v_min, u1_max", limits, bound)
    side = role.name.lower()
    own_sensors = game.sensors and game.sensors[role]
    own_drive = game.drives and game.drives[role]
    sensors = Sensing(**{side: own_sensors}) if own_sensors else None
    drives = Drives(**{side: own_drive}) if own_drive else None
    own_bounds = game.uncertainty and game.uncertainty[role]
    uncertainty = Uncertainties(**{side: own_bounds}) if own_bounds else None
    rules = with_chart(game) if policy.needs_chart else game
    player_game = replace(rules, sensors=sensors, drives=drives, uncertainty=uncertainty)
    if player_game.chart is not None and sensors is None:
        player_game = replace(player_game, chart=replace(player_game.chart, links=None))
    return Player(
        name if isinstance(name, str) else named_player.name,
        role,
        player_game,
        policy,
        transpose_layers(policy),
    )


def state_of(
    state: Float[Array, "robots 4"],
    active: Bool[Array, " robots"] | None,
    role: Role,
    sides: BySide[int],
) -> GameState:
    """Make the state of a game from the robots' numbers.

    Args:
        state: x [m], y [m], speed [m/s] and heading [rad] of every robot, those of `role` first,
            `[robots, 4]`.
        active: Whether each robot is in play, `[robots]`; None for two robots.
        role: The side of the first robots.
        sides: Numbers of robots.
    """
    num_own = sides[role]
    robots = [RobotState(*row) for row in state]
    robots_by_side = BySide.of(role, tuple(robots[:num_own]), tuple(robots[num_own:]))
    start = GameState.at_start(robots_by_side)
    if active is None:
        return start

    def status_of(is_active: Array) -> Array:
        code = jnp.where(is_active, RobotStatus.ACTIVE, RobotStatus.HIT_OBSTACLE)
        return code.astype(jnp.int32)

    status = [status_of(is_active) for is_active in active]
    return replace(start, status=BySide.of(role, tuple(status[:num_own]), tuple(status[num_own:])))


def transpose_layers(tree: Any) -> Any:
    """Return a pytree with all layers' weights transposed: the inner loop of a product then reads
    them in a row.
    """

    def transpose_layer(part: Any) -> Any:
        is_layer = isinstance(part, eqx.nn.Linear)
        return eqx.tree_at(lambda layer: layer.weight, part, part.weight.T) if is_layer else part

    return jax.tree.map(transpose_layer, tree, is_leaf=lambda part: isinstance(part, eqx.nn.Linear))
