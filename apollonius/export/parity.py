"""Comparison of an exported policy's decisions with those of the package's player."""

import functools
import timeit
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float32, PRNGKeyArray, UInt32

from apollonius.agents.classical import Uniform
from apollonius.agents.policy import AbstractActionValuePolicy
from apollonius.agents.pool import Pool, single_player
from apollonius.agents.wrappers.backup import MARGIN
from apollonius.agents.wrappers.identification import Identifying
from apollonius.agents.wrappers.shield import Shielded
from apollonius.export.player import LARGEST, Player, knowledge_and_memory, pack_memory
from apollonius.game.game import Game, reset_batch
from apollonius.game.sensing import sense
from apollonius.game.types import ROLES, BySide, GameState, RandomBits, Role, tree_where
from apollonius.observe.tracking import Track, apply_delay
from apollonius.observe.view import view_of
from apollonius.play.rollout import Games, SideState, collect, init_games

BREADTH = 1e-5
"""Distance from a state [m, m/s, rad] within which a decision of the package's player counts as the
same: single precision rounds as much, and a chart's values or a shield's consent can jump there."""
TOLERANCE = 1e-4
"""Greatest difference of a control from the package's, as a share of its largest value; single
precision causes 7e-6."""
_GAMES = 100
_SPACING = 5
"""Steps between two compared states: those in between are similar."""
_CHUNK = 500
_AROUND = 64

Decide = Callable[
    [Float32[np.ndarray, "robots 4"], Any, Any, Any, Any], tuple[np.ndarray, np.ndarray]
]
"""From state, who is in play, movers, memory and random bits to action and controls, as
`Player.decide`.
"""


class Cases(NamedTuple):
    """Inputs of decisions, leaves `[cases]`; see `Player.decide`."""

    states: Float32[np.ndarray, "*cases robots 4"]
    active: Bool[np.ndarray, "*cases robots"] | None
    movers: Float32[np.ndarray, "*cases movers 4"] | None
    memory: Any
    bits: UInt32[np.ndarray, "*cases"]

    def at(self, index: Any) -> "Cases":
        """Return some cases, or one."""
        return jax.tree.map(lambda leaf: leaf[index], self)


@dataclass(frozen=True)
class Parity:
    """Numbers of states in which the decisions of an exported policy and of the package's player
    differ.

    Ties differ within rounding: an action of the same value, or the player's decision within
    `BREADTH` of the state; all other differences are errors. `away` is the largest difference of a
    control, as a share of its largest value.
    """

    states: int
    ties: int
    errors: int
    away: float


def cases_of(player: Player, count: int, seed: int = 0) -> Cases:
    """Return states of games against a random opponent, 100 at a time; a game that ends begins
    again.
    """
    policy, role = single_player(player.package), player.role
    states, side, bits = _play(player.game, policy, role, jax.random.key(seed), -(-count // _GAMES))
    own_track = side.track
    seen_states = states
    if own_track is not None:
        seen_states = sensor_inputs(player.game, own_track, states, role, bits)
        own_track = replace(own_track, sightings=None)
    track, drive = jax.tree.map(lambda leaf: leaf[:, None], (own_track, side.drives[0]))
    memory = pack_memory(track, drive, side.memory)
    robots = (*seen_states.robots[role], *seen_states.robots[role.other])
    rows = [np.stack(jax.tree.leaves(robot), axis=-1) for robot in robots]
    active = None
    if player.robots > 2:
        active = np.stack([*states.active[role], *states.active[role.other]], axis=-1)[:count]
    movers = None
    if seen_states.movers is not None:
        movers = np.stack(jax.tree.leaves(seen_states.movers.motion), axis=-1)[:count]
    first = jax.tree.map(lambda leaf: np.asarray(leaf)[:count, 0], memory)
    return Cases(np.stack(rows, axis=1)[:count], active, movers, first, np.asarray(bits)[:count])


@functools.partial(jax.jit, static_argnames="role")
def sensor_inputs(
    game: Game, tracks: Track, states: GameState, role: Role, bits: UInt32[Array, " cases"]
) -> GameState:
    """Return the states as inputs of a robot with sensors: opponents and movers out of its sight
    are far away.

    Args:
        game: The game.
        tracks: The robot's track of its opponents in each case.
        states: The true states.
        role: The robot's side.
        bits: Random bits of each case.
    """

    def as_sensed(track: Track, state: GameState, bits: RandomBits) -> GameState:
        sensors = game.sensors and game.sensors[role]
        assert sensors is not None, "it tracks by them"
        percept = sense(sensors, game.arena, state, role, bits)
        _, past = apply_delay(sensors, track.pending, percept)
        far = jax.tree.map(lambda number: jnp.full_like(number, 2 * LARGEST), state.robots[role][0])
        opponents = tuple(
            tree_where(is_seen, opponent, far)
            for opponent, is_seen in zip(past.opponents, past.in_sight, strict=True)
        )
        movers, is_seen = state.movers, sensors.movers_in_sight(game.arena, state, role)
        if movers is not None and is_seen is not None:
            far_away = jax.tree.map(lambda leaf: jnp.full_like(leaf, 2 * LARGEST), movers.motion)
            movers = replace(movers, motion=tree_where(is_seen, movers.motion, far_away))
        return replace(state, robots=BySide.of(role, percept.own, opponents), movers=movers)

    return jax.vmap(as_sensed)(tracks, states, bits)


@functools.partial(jax.jit, static_argnames=("role", "rows"))
def _play(
    game: Game, player: Pool, role: Role, key: PRNGKeyArray, rows: int
) -> tuple[GameState, SideState, UInt32[Array, " cases"]]:
    start_key, word_key, play_key, bits_key = jax.random.split(key, 4)
    players = ROLES.map(lambda side: player if side == role else single_player(Uniform()))
    all_starts = reset_batch(game, start_key, rows * _GAMES)
    starts = jax.tree.map(lambda leaf: leaf.reshape(rows, _GAMES, *leaf.shape[1:]), all_starts)
    first = jax.tree.map(lambda leaf: leaf[0], starts)
    games = init_games(game, first, players, jax.random.bits(word_key, (2, _GAMES), jnp.uint32))

    def step(games: Games, row: Array) -> tuple[Games, tuple[GameState, SideState]]:
        fresh = jax.tree.map(lambda leaf: leaf[row][None], starts)
        after, _ = collect(game, players, games, fresh, jax.random.fold_in(play_key, row), _SPACING)
        return after, (games.state, games.sides[role])

    visited = jax.lax.scan(step, games, jnp.arange(rows))[1]
    states, side = jax.tree.map(lambda leaf: leaf.reshape(rows * _GAMES, *leaf.shape[2:]), visited)
    return states, side, jax.random.bits(bits_key, (rows * _GAMES,), jnp.uint32)


def reference(player: Player, cases: Cases) -> tuple[np.ndarray, Float32[np.ndarray, "cases 2"]]:
    """Return the actions and the controls of the package's player."""
    decide = _batched(player.decide)
    batches = []
    for first in range(0, len(cases.states), _CHUNK):
        # Chunks of one size need one compilation only.
        index = np.minimum(np.arange(first, first + _CHUNK), len(cases.states) - 1)
        decisions = decide(player.policy, player.game, *cases.at(index))
        batches.append(jax.device_get((decisions["action"], decisions["controls"])))
    actions, controls = (
        np.concatenate(parts)[: len(cases.states)] for parts in zip(*batches, strict=True)
    )
    return actions, controls


@functools.cache
def _batched(decide: Callable[..., Any]) -> Callable[..., Any]:
    return jax.jit(jax.vmap(decide, in_axes=(None, None, 0, 0, 0, 0, 0)))


def compare_decisions(decide: Decide, player: Player, cases: Cases) -> Parity:
    """Count the cases in which an exported policy differs from the package's player."""
    actions, controls = reference(player, cases)
    body = player.game.bodies[player.role][0]
    largest = player.largest
    decisions = [decide(*cases.at(place)) for place in range(len(cases.states))]
    actions_of_export, controls_of_export = zip(*decisions, strict=True)
    deviation = np.abs(np.array(controls_of_export) - controls) / largest
    differ = ~(deviation <= TOLERANCE).all(axis=1)  # also where one is NaN
    if not player.policy.continuous:
        differ |= np.array(actions_of_export).reshape(actions.shape) != actions
    ties = 0
    for place in map(int, np.flatnonzero(differ)):
        is_tie = False
        exported_controls = np.array(controls_of_export[place])
        if not player.policy.continuous:
            action = int(actions_of_export[place])
            own_action = int(actions[place])
            action_controls = np.array(body.controls(jnp.int32(action)))
            errors = np.abs(exported_controls - action_controls)
            is_tie = (
                action != own_action
                and bool((errors <= TOLERANCE * largest).all())
                and _is_as_good(player, cases, place, action, own_action)
            )
        ties += is_tie or _is_tie(player, cases, place, exported_controls)
    largest_deviation = float(deviation[~differ].max(initial=0))
    return Parity(len(actions), ties, int(differ.sum()) - ties, largest_deviation)


def _is_as_good(player: Player, cases: Cases, place: int, action: int, own: int) -> bool:
    """Test whether a player values this action like its own, to `TOLERANCE`, and its shield allows
    it; or whether the shield's consent to either hangs on rounding.
    """
    policy = player.package
    state, active, movers, memory, bits = cases.at(place)
    sides = player.game.bodies.map(len)
    in_play = None if active is None else jnp.asarray(active)
    movers = None if movers is None else jnp.asarray(movers)
    knowledge, _, _, memory = knowledge_and_memory(
        player.game, player.role, sides, jnp.asarray(state), in_play, movers, memory
    )
    view = view_of(player.game, knowledge, player.role)
    if isinstance(policy, Identifying):
        before, memory = memory
        view = policy.view_of(view, policy.estimate_after(view, before))
        policy = policy.policy
    if isinstance(policy, Shielded):
        backup = policy.backup.for_view(view)
        clearance, own_clearance = (
            float(backup.clearance_after(view.own, jnp.int32(number))) for number in (action, own)
        )
        if min(abs(clearance - MARGIN), abs(own_clearance - MARGIN)) <= BREADTH:
            return True
        if clearance <= MARGIN:
            return False
        memory = memory[0] if policy.backup.is_uncertain else memory
        policy = policy.policy
    if not isinstance(policy, AbstractActionValuePolicy):
        return False
    values = np.asarray(policy.score(policy.observation(view), memory, jnp.uint32(bits))[0])
    return bool(abs(values[action] - values[own]) <= TOLERANCE * np.abs(values).max())


def _is_tie(player: Player, cases: Cases, place: int, driven: np.ndarray) -> bool:
    """Test whether the package's player has these controls near a state; if continuous, in its
    range.
    """
    state, *inputs = cases.at(place)
    rng = np.random.default_rng(0)
    offsets = rng.uniform(-BREADTH, BREADTH, (_AROUND, *state.shape)).astype(np.float32)

    def repeat(leaf: Any) -> np.ndarray:
        return np.broadcast_to(leaf, (_AROUND, *np.shape(leaf)))

    _, controls = reference(player, Cases(state + offsets, *jax.tree.map(repeat, tuple(inputs))))
    if player.policy.continuous:
        controls = np.clip(driven, controls.min(axis=0), controls.max(axis=0))[None]
    return bool((np.abs(controls - driven) <= TOLERANCE * player.largest).all(axis=1).any())


def microseconds(call: Callable[[], object]) -> float:
    """Return the median time of 10,000 calls."""
    return 1e6 * float(np.median(timeit.repeat(call, number=1, repeat=10_000)))
