"""Whether a program in C does what its JAX function does, and an exported policy what the package's player does."""

import functools
import timeit
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import jaxpr_as_fun
from jaxtyping import Array, Bool, Float32, PRNGKeyArray, UInt32

from apollonius.agents.classical import Uniform
from apollonius.agents.policy import AbstractActionValuePolicy
from apollonius.agents.pool import Pool, solo
from apollonius.agents.shield import MARGIN, Shielded
from apollonius.export.c import Compiled, Program
from apollonius.export.player import LARGEST, Player, known_state, remembered
from apollonius.game.game import Game, reset_batch
from apollonius.game.sensing import sense
from apollonius.game.types import ROLES, Bits, BySide, GameState, Role, choose
from apollonius.io.errors import InvalidInput
from apollonius.observe.tracking import Track, delayed
from apollonius.observe.view import look
from apollonius.play.rollout import Games, SideState, begin, collect

BREADTH = 1e-5
"""How far around a state [m, m/s, rad] the package's player may do what an exported one does in it: single precision
rounds as much, and what is seen of a chart, or a shield's consent, can jump there."""
TOLERANCE = 1e-4
"""By how much of its largest value a control may differ from the package's. Single precision makes 7e-6 of it."""
_GAMES = 100
_SPACING = 5
"""Steps between two states that are kept: the ones between are much like them."""
_CHUNK = 500
_AROUND = 64
_NEAR, _NEARBY = (0.1, 0.01), 3
"""How far from its arguments a program is tried: in shares of a number, or of the least; and how often."""

Decide = Callable[[Float32[np.ndarray, "robots 4"], Any, Any, Any], tuple[np.ndarray, np.ndarray]]
"""From state, who is in play, memory and random bits to action and controls, as `Player.decide`."""


class Cases(NamedTuple):
    """What a player is asked, leaves `[cases]`; see `Player.decide`."""

    states: Float32[np.ndarray, "*cases robots 4"]
    active: Bool[np.ndarray, "*cases robots"] | None
    memory: Any
    bits: UInt32[np.ndarray, "*cases"]

    def at(self, index: Any) -> "Cases":
        """Return some cases, or one."""
        return jax.tree.map(lambda leaf: leaf[index], self)


@dataclass(frozen=True)
class Parity:
    """In how many of some states an exported policy did what the package's player did not.

    Ties are within rounding: an action of the same value, or what the player does within `BREADTH` of the state; all
    others are errors. The largest difference of a control is `away`, in shares of its largest value.
    """

    states: int
    ties: int
    errors: int
    away: float


def cases_of(player: Player, count: int, seed: int = 0) -> Cases:
    """Return states of games against a random opponent, 100 at a time; a game that ends begins again."""
    policy, role = solo(player.package), player.role
    states, side, bits = _play(player.game, policy, role, jax.random.key(seed), -(-count // _GAMES))
    known, seen = side.track, states
    if known is not None:
        seen, known = as_given(player.game, known, states, role, bits), replace(known, sightings=None)
    track, drive = jax.tree.map(lambda leaf: leaf[:, None], (known, side.drives[0]))
    memory = remembered(track, drive, side.memory)
    rows = [np.stack(jax.tree.leaves(robot), axis=-1) for side in (role, role.other) for robot in seen.robots[side]]
    active = None
    if states.status is not None:
        active = np.stack([*states.active[role], *states.active[role.other]], axis=-1)[:count]
    first = jax.tree.map(lambda leaf: np.asarray(leaf)[:count, 0], memory)
    return Cases(np.stack(rows, axis=1)[:count], active, first, np.asarray(bits)[:count])


@functools.partial(jax.jit, static_argnames="role")
def as_given(game: Game, tracks: Track, states: GameState, role: Role, bits: UInt32[Array, " cases"]) -> GameState:
    """Return the states as a robot with sensors is given them: opponents that it does not see now are far away."""

    def given(track: Track, state: GameState, bits: Bits) -> GameState:
        sensors = game.sensors and game.sensors[role]
        assert sensors is not None, "it tracks by them"
        now = sense(sensors, game.arena, state, role, bits)
        _, past = delayed(sensors, track.late, now)
        far = jax.tree.map(lambda number: jnp.full_like(number, 2 * LARGEST), state.robots[role][0])
        opponents = tuple(choose(seen, opponent, far) for opponent, seen in zip(past.opponents, past.seen, strict=True))
        return replace(state, robots=BySide.of(role, now.own, opponents))

    return jax.vmap(given)(tracks, states, bits)


@functools.partial(jax.jit, static_argnames=("role", "rows"))
def _play(
    game: Game, player: Pool, role: Role, key: PRNGKeyArray, rows: int
) -> tuple[GameState, SideState, UInt32[Array, " cases"]]:
    start_key, word_key, play_key, bits_key = jax.random.split(key, 4)
    players = ROLES.map(lambda side: player if side == role else solo(Uniform()))
    starts = jax.tree.map(lambda leaf: leaf.reshape(rows, _GAMES), reset_batch(game, start_key, rows * _GAMES))
    first = jax.tree.map(lambda leaf: leaf[0], starts)
    games = begin(game, first, players, jax.random.bits(word_key, (2, _GAMES), jnp.uint32))

    def step(games: Games, row: Array) -> tuple[Games, tuple[GameState, SideState]]:
        fresh = jax.tree.map(lambda leaf: leaf[row][None], starts)
        after, _ = collect(game, players, games, fresh, jax.random.fold_in(play_key, row), _SPACING)
        return after, (games.state, games.sides[role])

    kept = jax.lax.scan(step, games, jnp.arange(rows))[1]
    states, side = jax.tree.map(lambda leaf: leaf.reshape(rows * _GAMES, *leaf.shape[2:]), kept)
    return states, side, jax.random.bits(bits_key, (rows * _GAMES,), jnp.uint32)


def reference(player: Player, cases: Cases) -> tuple[np.ndarray, Float32[np.ndarray, "cases 2"]]:
    """Return the actions and the controls of the package's player."""
    decide, found = _batched(player.decide), []
    for first in range(0, len(cases.states), _CHUNK):
        index = np.minimum(np.arange(first, first + _CHUNK), len(cases.states) - 1)  # one compilation serves all
        made = decide(player.policy, player.game, *cases.at(index))
        found.append(jax.device_get((made["action"], made["controls"])))
    actions, controls = (np.concatenate(parts)[: len(cases.states)] for parts in zip(*found, strict=True))
    return actions, controls


@functools.cache
def _batched(decide: Callable[..., Any]) -> Callable[..., Any]:
    return jax.jit(jax.vmap(decide, in_axes=(None, None, 0, 0, 0, 0)))


def compare(decide: Decide, player: Player, cases: Cases) -> Parity:
    """Return in how many cases an exported policy differs from the package's player."""
    actions, controls = reference(player, cases)
    body, largest = player.game.bodies[player.role][0], player.largest
    said, driven = zip(*(decide(*cases.at(place)) for place in range(len(cases.states))), strict=True)
    away = np.abs(np.array(driven) - controls) / largest
    differ = ~(away <= TOLERANCE).all(axis=1)  # also where one is NaN
    if not player.policy.continuous:
        differ |= np.array(said).reshape(actions.shape) != actions
    ties = 0
    for place in map(int, np.flatnonzero(differ)):
        alike = False
        if not player.policy.continuous and int(said[place]) != int(actions[place]):
            held = np.array(body.controls(jnp.int32(said[place])))
            alike = bool((np.abs(driven[place] - held) <= TOLERANCE * largest).all())
            alike = alike and _is_as_good(player, cases, place, int(said[place]), int(actions[place]))
        ties += alike or _is_tie(player, cases, place, np.array(driven[place]))
    return Parity(len(actions), ties, int(differ.sum()) - ties, float(away[~differ].max(initial=0)))


def _is_as_good(player: Player, cases: Cases, place: int, action: int, own: int) -> bool:
    """Return whether a player values this action as its own, to `TOLERANCE`, and its shield allows it."""
    policy, (state, active, memory, bits) = player.package, cases.at(place)
    sides = player.game.bodies.map(len)
    in_play = None if active is None else jnp.asarray(active)
    known, _, _, memory = known_state(player.game, player.role, sides, jnp.asarray(state), in_play, memory)
    view = look(player.game, known, player.role)
    if isinstance(policy, Shielded):
        left = policy.backup.of(view).clearance_after(view.own, jnp.int32(action))
        if left <= MARGIN - BREADTH:
            return False
        policy = policy.policy
    if not isinstance(policy, AbstractActionValuePolicy):
        return False
    values = np.asarray(policy.weigh(policy.observation(view), memory, jnp.uint32(bits))[0])
    return bool(abs(values[action] - values[own]) <= TOLERANCE * np.abs(values).max())


def _is_tie(player: Player, cases: Cases, place: int, driven: np.ndarray) -> bool:
    """Return whether the package's player drives so around a state; if continuous, whether this is in its range."""
    state, *rest = cases.at(place)
    moved = np.random.default_rng(0).uniform(-BREADTH, BREADTH, (_AROUND, *state.shape)).astype(np.float32)
    many = jax.tree.map(lambda leaf: np.broadcast_to(leaf, (_AROUND, *np.shape(leaf))), tuple(rest))
    _, controls = reference(player, Cases(state + moved, *many))
    if player.policy.continuous:
        controls = np.clip(driven, controls.min(axis=0), controls.max(axis=0))[None]
    return bool((np.abs(controls - driven) <= TOLERANCE * player.largest).all(axis=1).any())


def require_same(program: Program, function: Callable[..., Any], arguments: Sequence[Any]) -> None:
    """Refuse, by InvalidInput, a program in C whose results are not those of its JAX function, for the arguments and
    some near them: between what JAX says around those, to `TOLERANCE` of the largest number.
    """
    closed, in_c = jax.make_jaxpr(function)(*arguments), Compiled(program)
    in_jax, rng = jax.jit(jaxpr_as_fun(closed)), np.random.default_rng(0)
    leaves, shape = jax.tree.flatten(tuple(arguments))
    first = [
        np.ones(aval.shape, aval.dtype) if isinstance(leaf, jax.ShapeDtypeStruct) else np.asarray(leaf, aval.dtype)
        for leaf, aval in zip(leaves, closed.in_avals, strict=True)
    ]

    def near(given: list[np.ndarray], breadth: float, least: float) -> list[np.ndarray]:
        """Return numbers of which the real ones are moved, in shares of themselves or of the least."""
        sizes = [breadth * np.maximum(abs(one), least) * (one.dtype == np.float32) for one in given]
        return [
            np.where(np.isfinite(one), one + size * rng.uniform(-1, 1, one.shape), one).astype(one.dtype)
            for one, size in zip(given, sizes, strict=True)
        ]

    for given in (first, *(near(first, *_NEAR) for _ in range(_NEARBY))):
        results = in_c(*jax.tree.unflatten(shape, given))
        answers = [in_jax(*given)]
        if not _is_among(results, answers):
            answers += [in_jax(*near(given, BREADTH, 1.0)) for _ in range(_AROUND)]
        if not _is_among(results, answers):
            raise InvalidInput(f"the program {program.name} in C differs from JAX: report this as an error.")


def _is_among(results: Sequence[np.ndarray], answers: Sequence[Sequence[Any]]) -> bool:
    """Return whether all numbers are between those of the answers, or are NaN where one is."""
    for result, *several in zip(results, *answers, strict=True):
        rows = np.array(several, float)
        slack = TOLERANCE * abs(rows[np.isfinite(rows)]).max(initial=1e-3) * (result.dtype == np.float32)
        between = (np.fmin.reduce(rows) - slack <= result) & (result <= np.fmax.reduce(rows) + slack)
        if not (between | (np.isnan(rows).any(axis=0) & np.isnan(result))).all():
            return False
    return True


def microseconds(call: Callable[[], object]) -> float:
    """Return the median time of 10,000 calls."""
    return 1e6 * float(np.median(timeit.repeat(call, number=1, repeat=10_000)))
