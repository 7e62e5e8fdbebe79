"""How every test runs: no silent promotion, compilations kept between runs, the same examples each time."""

import functools
import gc
import os
import shutil
from itertools import combinations
from pathlib import Path

import hypothesis
import jax
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from apollonius.io.cache import VARIABLE, keep_compilations

jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")
jax.config.update("jax_disable_most_optimizations", True)  # tests compile more than they compute
os.environ["JAX_DISABLE_MOST_OPTIMIZATIONS"] = "1"  # and so do the commands that they run as processes
# XLA reads this when it first compiles. Its older code generator takes a third of the time to compile what trains.
os.environ["XLA_FLAGS"] = "--xla_cpu_use_fusion_emitters=false --xla_cpu_parallel_codegen_split_count=1"
os.environ.setdefault(VARIABLE, str(Path(__file__).parents[1] / ".jax_cache"))
keep_compilations()
gc.freeze()
gc.set_threshold(100_000, 50, 100)  # tracing makes many objects, of which hardly any go in circles
MOST_MAPS = 40_000
"""Memory maps of a process at which it forgets its compilations; Linux allows 65,530."""
MOST_GROWTH = 2 << 30
"""Bytes of memory by which it has grown since it last did so, at which it does so again."""

hypothesis.settings.register_profile("apollonius", deadline=None, derandomize=True, max_examples=100)
hypothesis.settings.load_profile("apollonius")


HELD = {"bytes": 0}
"""What this process held when it last forgot its compilations."""


def resident() -> int:
    """The memory that this process holds [bytes]; 0 where the system does not tell."""
    told = Path("/proc/self/statm")
    return int(told.read_text(encoding="utf-8").split()[1]) * os.sysconf("SC_PAGE_SIZE") if told.exists() else 0


@pytest.fixture(scope="session", autouse=True)
def charts_are_kept():
    """Those of the few arenas that many tests play in."""
    from apollonius.arenas.charting import _latest  # types are checked in what is imported after this file

    _latest._most = 32


@pytest.fixture(scope="session", autouse=True)
def no_line_of_progress_comes_between():
    """However busy the machine is; tests of these lines set their own time."""
    from apollonius.cli import display

    display._FIRST_LINE_SECONDS = display._LOADING_SECONDS = 600.0


@pytest.fixture(scope="module", autouse=True)
def forget_compilations():
    """A process that keeps the compilations of a thousand tests comes to the end of its maps or of the memory."""
    yield
    maps = Path("/proc/self/maps")
    many = not maps.exists() or maps.read_bytes().count(b"\n") > MOST_MAPS
    if many or resident() - HELD["bytes"] > MOST_GROWTH:
        jax.clear_caches()
        gc.collect()
        HELD["bytes"] = resident()


@pytest.fixture(scope="session", autouse=True)
def figures_can_be_read():
    """In every figure that a test saves, panels fill it, data fill the panels, and neither these nor words overlap."""
    save = Figure.savefig

    @functools.wraps(save)
    def checked(figure, *arguments, **options):
        save(figure, *arguments, **options)
        renderer, words = FigureCanvasAgg(figure).get_renderer(), set()
        figure.draw_without_rendering()
        panels = [*figure.axes, *(inset for axes in figure.axes for inset in axes.child_axes)]
        for axes in panels:
            data, shown = axes.dataLim, axes.viewLim
            assert max(abs(data.width / shown.width), abs(data.height / shown.height)) > 0.9
            numbers = {*axes.get_xticklabels(), *axes.get_yticklabels()}
            words |= {word for word in {*axes.findobj(Text)} - numbers if word.get_visible() and word.get_text()}
        for one, other in [*combinations(words, 2), *combinations(panels, 2)]:
            assert not one.get_window_extent(renderer).overlaps(other.get_window_extent(renderer)), (one, other)
        assert sum(axes.bbox.width * axes.bbox.height for axes in panels) > 0.45 * figure.bbox.size.prod()

    Figure.savefig = checked
    yield
    Figure.savefig = save


@pytest.fixture(scope="session")
def demo(tmp_path_factory):
    """The run that the site reports on, with every fortieth record and those with evaluations: not to be changed."""
    folder = shutil.copytree(Path(__file__).parents[1] / "docs/results/demo", tmp_path_factory.mktemp("runs") / "demo")
    lines = (folder / "metrics.jsonl").read_text().splitlines(keepends=True)
    kept = [line for number, line in enumerate(lines) if number % 40 == 0 or '"evaluation"' in line]
    (folder / "metrics.jsonl").write_text("".join(kept))
    return folder


@pytest.fixture(scope="session")
def browser():
    """One for all tests that open pages."""
    from tests.web.browser import CHROMIUM, FLAGS, playwright

    with playwright.sync_playwright() as driver:
        chromium = driver.chromium.launch(executable_path=CHROMIUM, args=FLAGS.split())
        yield chromium
        chromium.close()


LONGEST = (
    "test_parity.py", "test_run.py", "test_player.py", "test_gymnasium.py", "test_tracking.py", "test_card.py",
    "test_joint.py", "test_cli.py", "test_page.py", "test_classical.py", "test_shield.py", "test_dqn.py",
    "test_report.py", "test_rollout.py", "test_physics.py", "test_animation.py", "test_loop.py", "test_opponents.py",
    "test_server.py", "test_suite.py", "test_motion.py", "test_outcome.py", "test_free_space.py", "test_reproduce.py",
    "test_file.py", "test_solving.py", "test_match.py", "test_site.py", "test_fuzzing.py",
)  # fmt: skip
"""Files whose tests take ten seconds and more, which begin before all others, so that no core waits in the end."""


def pytest_collection_modifyitems(items):
    items.sort(key=lambda item: LONGEST.index(item.path.name) if item.path.name in LONGEST else len(LONGEST))


RUNNING = ("test_attackers.py", "test_joint.py")
"""Files whose programs solve games, and run for longer than it takes to compile them well."""
TRAINING = ("exploit", "learn", "reproduce")
"""Folders whose tests train: Adam in optax raises a float to an integer power."""


@pytest.fixture(scope="module", autouse=True)
def compiled_and_promoted_as_needed(request):
    """Comes before the fixtures of the module; what is quick runs for less than it takes to compile."""
    runs_long = request.path.name in RUNNING and request.config.option.markexpr != "not slow"
    jax.config.update("jax_disable_most_optimizations", not runs_long)
    with jax.numpy_dtype_promotion("standard" if request.path.parent.name in TRAINING else "strict"):
        yield
    jax.config.update("jax_disable_most_optimizations", True)
