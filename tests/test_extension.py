"""A package of a user's own, as `docs/how-to/extend.md` shows it; and what is said of one that is wrong."""

import importlib.metadata
import json
import os
import re
import subprocess
import sys
import tomllib
from dataclasses import dataclass, replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import apollonius
from apollonius.catalogue import find_player, player_names
from apollonius.cli.main import main
from apollonius.cli.values import existing_agent
from apollonius.conformance.defects import Nonconformance
from apollonius.export.player import exported_side, training_game
from apollonius.game import arena as arenas
from apollonius.game.arena import Arena
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.obstacle import AbstractObstacle
from apollonius.game.presets import make_game
from apollonius.game.types import Role
from apollonius.io import extensions
from apollonius.io.errors import InvalidInput
from apollonius.learn.config import read_config
from apollonius.observe import registry
from apollonius.observe.observation import Mirror
from tests.documents import REPOSITORY, blocks

PAPER = make_game("paper")
FILES = {
    block.code.partition("\n")[0].removeprefix("# "): block.code
    for block in blocks(REPOSITORY / "docs" / "how-to" / "extend.md")
}
WALLED = """[[arena.capsules]]
x = 3
y = 5
to_x = 7
to_y = 6
radius = 0.3
"""


def install(folder, points, name="mine"):
    """Write what pip would about the entry points of a package."""
    about = folder / f"{name}-0.1.dist-info"
    about.mkdir()
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 0.1\n")
    lines = [f"[{group}]\n" + "".join(f"{key} = {value}\n" for key, value in some.items()) for group, some in points]
    (about / "entry_points.txt").write_text("\n".join(lines))


@pytest.fixture
def package_folder(tmp_path, monkeypatch):
    """A folder that packages are imported from, whose parts are gone after the test."""
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(arenas, "_KINDS", {})
    for name in list(registry.OBSERVATIONS):
        monkeypatch.setitem(registry.OBSERVATIONS, name, registry.OBSERVATIONS[name])
    registry.OBSERVATIONS.pop("camera", None)
    yield tmp_path
    registry.OBSERVATIONS.pop("camera", None)
    for module in [name for name in sys.modules if name.partition(".")[0] == "mine"]:
        del sys.modules[module]


@pytest.fixture
def mine(package_folder):
    """The package of the document."""
    for name in ("pyproject.toml", "mine/policy.py", "mine/capsule.py"):
        (package_folder / name).parent.mkdir(exist_ok=True)
        (package_folder / name).write_text(FILES[name])
    install(package_folder, tomllib.loads(FILES["pyproject.toml"])["project"]["entry-points"].items())
    return package_folder


def test_package_in_an_empty_folder_plays_in_evaluate(mine):
    (mine / "walled.toml").write_text(WALLED)
    paths = os.pathsep.join([str(mine), str(REPOSITORY)])
    command = [sys.executable, "-m", "apollonius", "evaluate", "mine:policy", "E_scratch", "--games", "20", "--json"]
    for options in ([], ["--game", "walled.toml"]):
        run = subprocess.run(
            [*command, *options], cwd=mine, env=os.environ | {"PYTHONPATH": paths}, capture_output=True, timeout=300
        )
        assert run.returncode == 0, run.stderr.decode()
        result = json.loads(run.stdout)
        assert (result["pursuer"], result["games"]) == ("mine:policy", 20)


def test_parts_of_a_package_are_found_by_name(mine, capsys):
    assert "mine:policy" in player_names(Role.EVADER, PAPER)
    player = find_player("shielded:mine:policy", Role.PURSUER, PAPER)
    assert (player.name, type(player.policy.policy).__name__) == ("shielded:mine:policy", "Chaser")
    assert existing_agent("shielded:mine:policy", "evader") == "shielded:mine:policy"
    with pytest.raises(Exception, match="did you mean 'mine:policy'"):
        existing_agent("mine:polcy")
    assert exported_side("mine:policy", "evader") is Role.EVADER
    assert training_game("mine:policy") == PAPER
    assert registry.find_observation("camera").size == 2
    (mine / "walled.toml").write_text(WALLED)
    game = apollonius.find_game(str(mine / "walled.toml"))
    assert list(game.arena.named_obstacles) == ["arena.capsules[0]"]
    assert main(["players"]) == 0
    assert "of other packages:\n  mine:policy" in capsys.readouterr().out
    with pytest.raises(InvalidInput, match="unknown observation 'camra'; did you mean 'camera'"):
        registry.find_observation("camra")


BROKEN = {
    ("players", "gone = mine.nothing:Policy"): lambda: find_player("mine:gone", Role.PURSUER, PAPER),
    ("players", "text = mine.wrong:TEXT"): lambda: find_player("mine:text", Role.PURSUER, PAPER),
    ("players", "needy = mine.wrong:Needy"): lambda: find_player("mine:needy", Role.PURSUER, PAPER),
    ("players", "none = mine.wrong:none"): lambda: find_player("mine:none", Role.PURSUER, PAPER),
    ("observations", "camera = mine.wrong:TEXT"): lambda: registry.find_observation("camera"),
    ("observations", "other = mine.wrong:PAPER"): lambda: registry.find_observation("other"),
    ("algorithms", "dqn-2 = mine.wrong:Needy"): lambda: read_config({"algorithm": {"kind": "dqn-2"}}, "config"),
    ("algorithms", "other = apollonius.learn.dqn:DQNConfig"): lambda: read_config(
        {"algorithm": {"kind": "other"}}, "config"
    ),
    ("obstacles", "walls = mine.wrong:TEXT"): lambda: arenas.find_obstacle_kind("walls"),
}


@pytest.mark.parametrize(("group", "point"), BROKEN, ids=str)
def test_broken_entry_point_is_refused_in_one_line_naming_the_package(group, point, package_folder):
    (package_folder / "mine").mkdir()
    (package_folder / "mine" / "wrong.py").write_text(
        "from apollonius.agents.policy import AbstractPolicy\nfrom apollonius.observe.paper import PAPER\n"
        "TEXT = 'text'\n\n\nclass Needy(AbstractPolicy):\n    speed: float\n\n"
        "    def __call__(self, seen, memory, bits):\n        return 0, memory\n\n\n"
        "def none(game, role):\n    return None\n"
    )
    name, _, value = point.partition(" = ")
    install(package_folder, [(f"apollonius.{group}", {name: value})])
    with pytest.raises(InvalidInput, match=rf"the package 'mine' has '{point}' .* mend it, or uninstall") as refusal:
        BROKEN[group, point]()
    assert "\n" not in str(refusal.value)


def test_two_packages_with_the_same_name_of_a_part_are_refused(package_folder):
    for package in ("mine", "yours"):
        install(package_folder, [(extensions.OBSTACLES, {"walls": "mine.capsule:Capsule"})], package)
    with pytest.raises(InvalidInput, match="the packages 'mine' and 'yours' both have 'walls'"):
        arenas.find_obstacle_kind("walls")


def test_entry_points_are_read_for_unknown_names_only(package_folder, monkeypatch):
    def refuse(**_):
        raise AssertionError("not for a name that is known")

    monkeypatch.setattr(importlib.metadata, "entry_points", refuse)
    assert find_player("intercept", Role.PURSUER, PAPER).name == existing_agent("intercept")
    assert registry.find_observation("paper").size == 8
    assert apollonius.find_game("office").arena.extra == ()
    with pytest.raises(AssertionError):
        existing_agent("mine:policy")


@dataclass(frozen=True)
class Short(apollonius.AbstractObservation):
    """One number, and says it has two, which a mirror leaves as they are."""

    name = "short"
    size = 2
    mirror = Mirror((0, 1), (1, 1))

    def __call__(self, view):
        return jnp.stack([view.own.state.x])


class Bearings(Short):
    """Two numbers, of which the second has the other sign in a mirror image."""

    def __call__(self, view):
        own, opponent = view.own.state, view.opponent.state
        return jnp.stack([opponent.x - own.x, opponent.y - own.y])


class Reader(apollonius.AbstractPolicy):
    """A policy of another observation."""

    reads: apollonius.AbstractObservation = eqx.field(static=True)

    @property
    def observation(self):
        return self.reads

    def __call__(self, seen, memory, bits):
        return jnp.int32(7), memory


class Branching(apollonius.AbstractPolicy):
    """A policy with `if`."""

    def __call__(self, seen, memory, bits):
        return (jnp.int32(7) if seen.own.state.v > 0 else jnp.int32(1)), memory


class Real(apollonius.AbstractPolicy):
    """A policy whose action is a real number, and whose memory grows."""

    def __call__(self, seen, memory, bits):
        return seen.own.state.v, (memory, jnp.int32(1))


class Moody(apollonius.AbstractPolicy):
    """A policy that draws numbers by NumPy."""

    def __call__(self, seen, memory, bits):
        return jnp.int32(np.random.default_rng().integers(2**31)), memory


class Printing(apollonius.AbstractPolicy):
    """A policy that prints."""

    def __call__(self, seen, memory, bits):
        jax.debug.print("{}", bits)
        return jnp.int32(4), memory


class Wild(apollonius.AbstractPolicy):
    """A policy of an action that is none, by a call of Python, and that takes what a shield forbids."""

    def __call__(self, seen, memory, bits):
        form = jax.ShapeDtypeStruct((), jnp.float32)
        level = jax.pure_callback(lambda speed: speed, form, seen.own.state.v, vmap_method="expand_dims")
        return (9 + level).astype(jnp.int32), memory

    def select(self, scores, allowed):
        return jnp.int32(4)


def defects(check, *arguments):
    """Return the lines of a check, by the property that each is about."""
    with pytest.raises(Nonconformance) as refusal:
        check(*arguments)
    assert all("\n" not in line for line in refusal.value.defects)
    return dict(line.split(": ", 1) for line in refusal.value.defects)


@pytest.mark.parametrize(
    ("policy", "name", "text"),
    [
        (Reader(Short()), "observation", r"float32 \[1\] .* float32 \[2\], as its size is"),
        (Branching(), "action and memory", "jnp.where or jax.lax.cond for if"),
        (Real(), "action and memory", r"action = float32 \[\] .* int32 \[\]"),
        (Moody(), "purity", "another in each trace .* take randomness from `bits`"),
        (Printing(), "purity", "take out callbacks and prints"),
    ],
)
def test_check_policy_reports_defects_before_playing(policy, name, text):
    lines = defects(apollonius.check_policy, policy, Role.PURSUER)
    assert list(lines) == [name]
    assert re.search(text, lines[name])


@pytest.mark.slow
def test_check_policy_reports_defects_found_by_playing():
    lines = defects(apollonius.check_policy, Wild(), Role.PURSUER)
    assert "from 0 to 8; clip it" in lines["batches and actions"]
    assert "an allowed action" in lines["choice"]
    assert "pure_callback" in lines["export"]
    lines = defects(apollonius.check_policy, Reader(Bearings()), Role.PURSUER)
    assert list(lines) == ["mirror"]
    assert "number 1 of mirror" in lines["mirror"]


class Squared(AbstractObstacle):
    """A pillar whose clearance is the square of a distance."""

    x: float = 5.0

    def clearance(self, x, y):
        return (x - self.x) ** 2 + (y - 5.0) ** 2 - 0.25


class Pillar(AbstractObstacle):
    """A pillar as it should be, but for what others add."""

    x: float = 5.0

    def clearance(self, x, y):
        return jnp.hypot(x - self.x, y - 5.0) - 0.5


class Leaping(Pillar):
    """A pillar whose contacts are looked for at a step's ends."""

    def clearance_along(self, before, after):
        return jnp.minimum(self.clearance(before.x, before.y), self.clearance(after.x, after.y))


class Timid(Pillar):
    """A pillar that is always touched."""

    def clearance_along(self, before, after):
        return super().clearance_along(before, after) - 1.0


class Blind(Pillar):
    """A pillar that is never touched."""

    def is_hit(self, before, after, radius):
        return jnp.zeros((), bool)


class Seen(Pillar):
    """A pillar that is in every line of sight."""

    def hides(self, here, there):
        return jnp.ones((), bool)


class Beside(Pillar):
    """A pillar that is drawn a metre beside its place."""

    def outline(self):
        return ((self.x + 1, 5.0), (self.x + 1.5, 5.0), (self.x + 1, 5.5))


class Fast(Unicycle):
    """A robot that knows no limits."""

    def move(self, robot, u1, u2, dt):
        return replace(robot, v=robot.v + 1.0, heading=robot.heading + 1.0)


@pytest.mark.slow
def test_check_game_reports_defects(package_folder):
    wrong = (Squared, Leaping, Timid, Blind, Seen, Beside)
    for kind in (*wrong, Pillar):
        arenas.register_obstacle(kind.__name__.lower(), kind)
    game = replace(PAPER, arena=Arena(extra=tuple(kind() for kind in (*wrong, Pillar))), pursuer=Fast())
    lines = defects(apollonius.check_game, game)
    assert {name.removeprefix("arena.") for name in lines} == {
        *(f"{kind.__name__.lower()}[0]" for kind in wrong), "pursuer",
    }  # fmt: skip
    for name, text in (
        ("arena.squared[0]", "a distance in metres"),
        ("arena.leaping[0]", "would pass through"),
        ("arena.timid[0]", "m less than that"),
        ("arena.blind[0]", "is_hit = false on"),
        ("arena.seen[0]", "hides = true on"),
        ("arena.beside[0]", "outline = a corner"),
        ("pursuer", "clip it in move"),
    ):
        assert text in lines[name], lines[name]
    arenas._KINDS.clear()
    lines = defects(apollonius.check_game, Game(arena=Arena(extra=(Pillar(),))))
    assert list(lines) == ["file"]
