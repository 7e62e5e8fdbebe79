"""Each number of a game counts, and none is repeated elsewhere: games are the same in other units."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.built_in import PLAYERS
from apollonius.agents.classical import AbstractClassical
from apollonius.agents.guidance import PurePursuit, Territory
from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.pool import single_player
from apollonius.agents.wrappers.backup import Backup
from apollonius.evaluate.match import Match, play_match
from apollonius.game.arena import Arena, Disc
from apollonius.game.drive import Drive, Drives
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.occupancy import OccupancyMap, distance_field
from apollonius.game.polygon import Polygon
from apollonius.game.presets import paper
from apollonius.game.sensing import Noise, Sensing, Sensors
from apollonius.game.starts import Starts
from apollonius.game.teams import Teams
from apollonius.game.types import BySide, Role
from apollonius.observe.paper import PAPER
from apollonius.play.rollout import init_games, step_games
from apollonius.solve.grid import make_grid
from apollonius.solve.safety import solve_safety

LENGTHS = "x y x_min x_max y_min y_max cell field radius vertices capture_distance clearance separation range position"
POWERS = dict.fromkeys(LENGTHS.split(), (1, 0)) | {
    "v_min": (1, -1), "v_max": (1, -1), "speed": (1, -1), "u1_max": (1, -2), "u2_max": (0, -1), "dt": (0, 1),
    "turn_time": (0, 1), "progress": (-1, 0), "max_steps": (0, 0), "capture": (0, 0), "failure": (0, 0),
    "heading": (0, 0), "field_of_view": (0, 0), "drop_out": (0, 0), "delay": (0, 0), "lag": (0, 0),
}  # fmt: skip
"""The powers of length and of time in all numbers of a game; a new one has to be named here."""
SCALES = (1, 1), (2, 1), (1, 2)
"""Units of length and of time. Powers of 2 round nothing."""
WITH_A_SCALE = {"flee-aware": "looks 4 s ahead"} | dict.fromkeys(
    ("search", "hide", "voronoi-pursuit", "encirclement"), "read charts, in centimetres, and keep metres apart"
)
"""Rules that are not the same in other units, and why; nor are networks, which read metres and seconds."""
RULES = [
    kind for name, (kind, _) in PLAYERS.items() if issubclass(kind, AbstractClassical) and name not in WITH_A_SCALE
]


def full_game():
    """Return a game that has every part."""
    cells = np.zeros((8, 8), bool)
    cells[6, 1] = True
    cell_map = OccupancyMap(jnp.asarray(distance_field(cells, 0.875)), 0.125, 0.125, 0.875, "", "")
    polygon, disc, goal = Polygon(((4.0, 4.0), (5.0, 4.25), (4.25, 5.0))), Disc(2.5, 2.0, 0.4), Disc(5.0, 1.5, 1.0)
    arena, body = Arena(0.5, 6.5, 0.25, 6.25, (disc,), (polygon,), cell_map, goal), Unicycle(0.0, 1.4, 0.8, 1.1, 0.1)
    noise, drive, starts = Noise(0.03, 0.05, 0.04), Drive(1, 0.3), Starts("moving", 0.3, 1.0)
    sensors, teams = Sensors(True, 3.5, 4.0, noise, noise, 0.5, 1), Teams((body,), (body,), True)
    sides = {"sensors": Sensing(sensors, sensors), "drives": Drives(drive, drive)}
    return Game(body, body, arena, 0.9, 0.25, 14, starts=starts, teams=teams, **sides)


def numbers_of(game):
    """Return the numbers of a game, and None for parts that it lacks, by their dotted paths."""
    leaves = jax.tree_util.tree_flatten_with_path(game, is_leaf=lambda leaf: leaf is None)[0]
    return {jax.tree_util.keystr(path, simple=True, separator="."): leaf for path, leaf in leaves}


def scale_number(name, number, length, time):
    """Return a number of a game in other units."""
    across, along = POWERS[next(part for part in reversed(name.split(".")) if not part.isdigit())]
    kind = np.int32 if name == "max_steps" else np.float32
    return (np.asarray(number) * float(length) ** across * float(time) ** along).astype(kind)


def vary_number(name, number):
    whole = name.endswith(("max_steps", "delay", "lag"))
    return number + 1 if whole else np.where(number == 0, 0.25, 1.5 * np.asarray(number))


class Witness(AbstractPolicy):
    """A player that remembers what rules and a shield make of what it sees."""

    driver: AbstractPolicy

    @property
    def memory(self):
        return jnp.zeros(8), jnp.zeros((len(RULES), 9)), jnp.zeros(9)

    def __call__(self, seen, memory, bits):
        backup = Backup(seen.arena, seen.dt, steps=16)
        clearances = jax.vmap(lambda action: backup.clearance_after(seen.own, action))(jnp.arange(9))
        values = jnp.stack([rule().values(seen) for rule in RULES])
        return self.driver(seen, (), bits)[0], (PAPER(seen), values, clearances)


@jax.jit
@jax.vmap
def courses(game):
    """Return what happens in a few games, the same of each game, by the powers of length and of time in it."""
    key, players = (
        jax.random.key(3),
        BySide(single_player(Witness(PurePursuit())), single_player(Witness(Territory(guards=False)))),
    )
    bits = jax.random.bits(key, (16, 2, 6), jnp.uint32)

    def step(games, bits):
        after, made = step_games(game, players, games, bits)
        x, y, v, heading = (jax.tree.leaves(after.state.robots)[number::4] for number in range(4))
        observations, values, clearances = zip(*(side.memory for side in after.sides), strict=True)
        events = made.outcome, after.state.status, [side.reward for side in made.sides]
        return after, {(0, 0): (heading, observations, values, events), (1, 0): (x, y, clearances), (1, -1): v}

    starts = jax.vmap(game.reset)(jax.random.split(key, 6))
    return jax.lax.scan(step, init_games(game, starts, players, bits[0]), bits)[1]


@pytest.mark.slow
def test_every_number_of_a_game_matters_and_scales_with_the_units():
    """Each is varied alone: these games differ from those before, and in nothing from themselves in other units."""
    game = full_game()
    numbers = {name: number for name, number in numbers_of(game).items() if number is not None}
    assert numbers_of(game).keys() - numbers.keys() == {"chart", "scenario"}, "all other parts are there"
    rows = [(scale, one) for scale in SCALES for one in ("none", *numbers)]
    games = [
        np.stack(
            [scale_number(name, vary_number(name, number) if name == one else number, *scale) for scale, one in rows]
        )
        for name, number in numbers.items()
    ]
    counts = np.zeros(len(numbers), bool)
    for (across, along), happened in courses(jax.tree.unflatten(jax.tree.structure(game), games)).items():
        for leaf in jax.tree.leaves(happened):
            plain, *others = np.asarray(leaf, float).reshape(len(SCALES), 1 + len(numbers), -1)
            counts |= np.any(plain[1:] != plain[0], axis=1)
            for (length, time), other in zip(SCALES[1:], others, strict=True):
                np.testing.assert_allclose(other, plain * length**across * time**along, 1e-4, 1e-5)
    assert [name for name, count in zip(numbers, counts, strict=True) if not count] == []


def safety_table(game):
    return solve_safety(game, Role.PURSUER, make_grid(game.arena, game.pursuer, (13, 13, 3, 8)), 5).table


def guarded_match(game):
    return play_match(Match.of_names(game, "shielded:pure-pursuit", "shielded:flee", games=16))


@pytest.fixture(scope="module")
def in_metres_and_seconds():
    """The table and the match of the game that others are scaled from."""
    return safety_table(paper()), guarded_match(paper())


@pytest.mark.parametrize(
    ("length", "time"),
    [SCALES[1], *[pytest.param(*scale, marks=pytest.mark.slow) for scale in [*SCALES[2:], (1, 0.5)]]],
)
def test_safety_tables_and_shielded_games_scale_with_the_units(length, time, in_metres_and_seconds):
    game, (table, result) = paper(), in_metres_and_seconds
    numbers = [scale_number(*one, length, time).item() for one in numbers_of(game).items() if one[1] is not None]
    other = jax.tree.unflatten(jax.tree.structure(game), numbers)
    np.testing.assert_allclose(safety_table(other), length * table, 1e-4)
    if length == 1:  # a shield leaves a millimetre, whatever the robots' scale
        assert guarded_match(other) == result
