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
from apollonius.agents.classical import BRAKE_STRAIGHT
from apollonius.agents.names import SEARCHING, SHIELDED
from apollonius.agents.policy import AbstractPolicy, Memory
from apollonius.agents.trained import find_trained
from apollonius.arenas.charting import charted
from apollonius.arenas.file import from_dict
from apollonius.catalogue import find_player
from apollonius.game.drive import Drives, drive_of
from apollonius.game.game import Game
from apollonius.game.presets import make_game
from apollonius.game.sensing import Percept, Sensing
from apollonius.game.types import Bits, BySide, DriveState, GameState, RobotState, RobotStatus, Role
from apollonius.io import extensions
from apollonius.io.errors import require
from apollonius.observe.registry import find_observation
from apollonius.observe.tracking import Track, believed, delayed, learn
from apollonius.observe.tracking import begin as known_first
from apollonius.observe.view import look

LARGEST = 1e6
"""No number of a state is beyond this. Compared is the sum of their squares: one test, and a NaN fails it too."""
_FALLBACK = -1.0, 0.0
"""Full braking straight ahead, as shares of the largest controls."""


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
    def largest(self) -> Float32[np.ndarray, "2"]:
        """Return the largest controls, u1 [m/s^2] and u2 [rad/s]; never 0."""
        body = self.game.bodies[self.role][0]
        return np.maximum(np.array([body.u1_max, body.u2_max], np.float32), 1e-6)

    @property
    def arguments(self) -> tuple[Any, ...]:
        """Return arguments of `decide`, the last three but examples."""
        active = jnp.ones(self.robots, bool) if self.robots > 2 else None
        states = jnp.zeros((self.robots, 4), jnp.float32)
        return self.policy, self.game, states, active, self.memory, jnp.uint32(0)

    @property
    def memory(self) -> Memory:
        """The memory with which every game begins: the policy's; with sensors what is known of opponents before it, and
        with a drive that is at rest.
        """
        state = GameState.at_start(self.game.bodies.map(lambda side: (RobotState(*jnp.zeros(4)),) * len(side)))
        track = known_first(self.game, state, self.role)
        drive = drive_of(self.game.drives, self.role).begin()
        return remembered(None if track is None else replace(track, sightings=None), drive, self.policy.memory)

    @property
    def decide(self) -> Callable[..., dict[str, Any]]:
        """Return the function that plays.

        Its arguments are the player and the game; x [m], y [m], speed [m/s] and heading [rad] of every robot, its own
        first, then its mates', then its opponents'; in teams whether each is in play; the memory that it returned last,
        or `self.memory` where a game begins; and 32 random bits. It returns the action (`types.Action`), the controls
        u1 [m/s^2] and u2 [rad/s], and the memory. A state with a NaN, or a number beyond `LARGEST`, and an action
        that is not finite are answered by full braking, straight ahead; with sensors an opponent of such a state is not
        seen now.
        """
        return _decide(self.role, self.game.bodies.map(len))


@functools.cache
def _decide(role: Role, sides: BySide[int]) -> Callable[..., dict[str, Any]]:
    def decide(
        player: AbstractPolicy,
        game: Game,
        state: Float[Array, "robots 4"],
        active: Bool[Array, " robots"] | None,
        memory: Memory,
        bits: Bits,
    ) -> dict[str, Any]:
        policy = transposed(player)
        known, track, drive, own = known_state(game, role, sides, state, active, memory)
        action, own = policy(policy.observation(look(game, known, role)), own, bits)
        given = state if track is None else state[: sides[role]]
        sane = jnp.sum(given * given) <= LARGEST**2
        if policy.continuous:
            sane &= jnp.isfinite(action).all()
        brake = jnp.array(_FALLBACK) if policy.continuous else jnp.int32(BRAKE_STRAIGHT)
        action = jnp.where(sane, action, brake)
        body = game.bodies[role][0]
        controls, (_, drive) = body.controls(action), drive_of(game.drives, role).respond(drive, body, action, game.dt)
        return {"action": action, "controls": jnp.stack(controls), "memory": remembered(track, drive, own)}

    return decide


def remembered(track: Track | None, drive: DriveState, own: Memory) -> Memory:
    """Return an exported player's memory: its policy's, alone where there is nothing else to remember."""
    return (track, drive, own) if jax.tree.leaves((track, drive)) else own


def known_state(
    game: Game, role: Role, sides: BySide[int], state: Array, active: Array | None, memory: Memory
) -> tuple[GameState, Track | None, DriveState, Memory]:
    """Return the state as a side knows it, by what it is given in this step and its memory, and that memory's parts.

    The robot's own drive is in the state that its commands lead to; those of its mates are not known.
    """
    sensors, drive = game.sensors and game.sensors[role], drive_of(game.drives, role)
    track, driven, own_memory = memory if sensors or jax.tree.leaves(drive) else (None, drive.begin(), memory)
    drives = (driven, *[drive.begin()] * (sides[role] - 1))
    if sensors is None or track is None:
        return replace(state_of(state, active, role, sides), drives=drives), None, driven, own_memory
    seen = jnp.sum(state * state, axis=1) <= LARGEST**2
    now = state_of(jnp.where(seen[:, None], state, 0.0), active, role, sides)
    own, opponents = now.robots[role], now.robots[role.other]
    percept = Percept(own, opponents, tuple(seen[len(own) :]), jnp.ones((), bool))
    late, past = delayed(sensors, track.late, percept)  # what is seen of opponents comes late already
    after = learn(game, replace(track, own=own, late=late), replace(percept, own=past.own), now, role)
    return replace(believed(game, after, now, role), drives=drives), after, driven, own_memory


def side_of(name: str, given: str | None = None) -> Role:
    """Return the side that a player plays, or the given one of a player of either; raises InvalidInput otherwise."""
    bare = name.removeprefix(SHIELDED).removeprefix(SEARCHING)
    sides = _sides_of_rule(bare) or (Role[find_trained(bare)[0].header.role.upper()],)
    named = [side.name.lower() for side in sides]
    require(given is None or given in named, "side", given, f"{' or '.join(named)}, which '{name}' plays")
    require(given or len(sides) == 1, "side", "missing", f"{' or '.join(named)}, as '{name}' plays either")
    return Role[given.upper()] if given else sides[0]


def _sides_of_rule(name: str) -> tuple[Role, ...]:
    """Return the sides that a player which was not trained can play, either for one of another package; else none."""
    if name in PLAYERS:
        return PLAYERS[name][1]
    return tuple(Role) if ":" in name and name in extensions.extension_names(extensions.PLAYERS) else ()


def home_of(name: str) -> Game:
    """Return the game that a player was made for, `paper` for none; raises InvalidInput for one of any arena."""
    bare = name.removeprefix(SHIELDED).removeprefix(SEARCHING)
    if _sides_of_rule(bare):
        return make_game("paper")
    header = find_trained(bare)[0].header
    require(header.game, "game", "missing", f"one arena, since '{name}' does not say what it was made for")
    in_one = header.game.get("scenario") is None and not find_observation(header.observation).charted
    require(in_one, "game", "missing", f"one arena, as office, since '{name}' plays in any")
    return from_dict(Game, header.game, f"'{name}'")


def find_exportable(name: str | AbstractPolicy, role: Role, game: Game) -> Player:
    """Return the player of this name, or a policy, to be exported.

    Raises InvalidInput as `find_player`, for games in several arenas, for networks with numbers that are none, and for
    a robot whose braking, the answer to a broken state, does not end at rest.
    """
    game.require_one_arena("an exported policy")
    found = find_player(name, role, game)
    policy = found.policy
    finite = all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(eqx.filter(policy, eqx.is_inexact_array)))
    require(finite, "weights", "NaN or infinite", "finite; train the agent again")
    body = game.bodies[role][0]
    bound = "0 m/s and more than 0 m/s^2, so that braking, the answer to a broken state, ends at rest"
    require(body.v_min == 0 and body.u1_max > 0, "v_min, u1_max", (float(body.v_min), float(body.u1_max)), bound)
    seeing = game.sensors and game.sensors[role]
    driven, own = game.drives and game.drives[role], role.name.lower()
    sensors, drives = (Sensing(**{own: seeing}) if seeing else None), (Drives(**{own: driven}) if driven else None)
    rules = charted(game) if policy.charted else game
    known = replace(rules, sensors=sensors, drives=drives)
    if known.arena.chart is not None and sensors is None:
        known = replace(known, arena=replace(known.arena, chart=replace(known.arena.chart, links=None)))
    return Player(name if isinstance(name, str) else found.name, role, known, policy, transposed(policy))


def state_of(
    state: Float[Array, "robots 4"], active: Bool[Array, " robots"] | None, role: Role, sides: BySide[int]
) -> GameState:
    """Return the state of a game from the robots' numbers, one side's first."""
    ours, robots = sides[role], [RobotState(*row) for row in state]
    both = BySide.of(role, tuple(robots[:ours]), tuple(robots[ours:]))
    begun = GameState.at_start(both)
    if active is None:
        return begun
    status = [jnp.where(one, RobotStatus.ACTIVE, RobotStatus.HIT_OBSTACLE).astype(jnp.int32) for one in active]
    return replace(begun, status=BySide.of(role, tuple(status[:ours]), tuple(status[ours:])))


def transposed(tree: Any) -> Any:
    """Return a pytree with all layers' weights transposed: the inner loop of a product then reads them in a row."""

    def turned(part: Any) -> Any:
        is_layer = isinstance(part, eqx.nn.Linear)
        return eqx.tree_at(lambda layer: layer.weight, part, part.weight.T) if is_layer else part

    return jax.tree.map(turned, tree, is_leaf=lambda part: isinstance(part, eqx.nn.Linear))
