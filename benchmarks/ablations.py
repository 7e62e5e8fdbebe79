"""Speed that each file of `apollonius.accelerate` buys:
`python benchmarks/ablations.py [NAME ...]`.

Each is left out alone, for the plain definition in its place. A process with it and one without it
run what users wait for in turns. Printed are the medians, over these turns, of the processor
seconds without it over those with it. Both are pinned to one core.
"""

import argparse
import importlib
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp

TURNS = 15
STEPS = 25
START_ROWS = 4
Run = Callable[[int], Any]
"""A measured piece of work: from the number of a turn to arrays."""


@dataclass(frozen=True)
class Ablation:
    """A form that is left out, and what is timed without it.

    Attributes:
        form: the module in `apollonius.accelerate`, and the function in it.
        plain: what takes the function's place.
        workload: sets up what is timed.
    """

    form: tuple[str, str]
    plain: Callable[[Callable[..., Any]], Callable[..., Any]]
    workload: Callable[[], Run]


@dataclass
class WithoutFor:
    """The replacement of a decorator, which leaves the functions of a name as they are."""

    name: str
    is_met: bool = False
    """Whether there is such a function: without one, nothing is left out."""

    def __call__(self, decorator: Callable[..., Any]) -> Callable[..., Any]:
        def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
            if getattr(function, "func", function).__name__ != self.name:
                return decorator(function)
            self.is_met = True
            return function

        return decorate


def without_any(_: Callable[..., Any]) -> Callable[..., Any]:
    """Return the replacement of a decorator that leaves all functions as they are."""
    return lambda function: function


def plain_bits(_: Callable[..., Any]) -> Callable[..., Any]:
    """Return JAX's own function for `threefry_bits`."""
    return partial(jax.random.bits, dtype=jnp.uint32)


def all_nearby(index_nearby: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function in whose index everything is near everywhere."""

    def index(distances: Any, reach: float, *squares: Any) -> Any:
        return index_nearby(distances, 1e4, *squares)

    return index


def random_play(name: str, games: int, reads: str | None = None) -> Run:
    """Play at random with auto-reset; both sides make the observation of a name."""
    from apollonius.agents.classical import Uniform
    from apollonius.agents.pool import single_player
    from apollonius.arenas.charting import with_chart
    from apollonius.arenas.file import find_game
    from apollonius.game.game import reset_batch
    from apollonius.game.types import BySide
    from apollonius.observe.registry import find_observation
    from apollonius.play.rollout import Games, collect, init_games

    class Reader(Uniform):
        @property
        def observation(self) -> Any:
            return find_observation(reads) if reads else super().observation

    needs_chart = reads is not None and find_observation(reads).needs_chart
    game, key = with_chart(find_game(name), needs_chart), jax.random.key(0)
    players = BySide(*[single_player(Reader())] * 2)
    drawn = jax.jit(reset_batch, static_argnums=2)(game, key, START_ROWS * games)
    starts = jax.tree.map(lambda leaf: leaf.reshape(START_ROWS, games, *leaf.shape[1:]), drawn)
    first = jax.tree.map(lambda leaf: leaf[0], starts)
    under_way = init_games(game, first, players, jax.random.bits(key, (2, games)))

    @jax.jit
    def play(under_way: Games, number: int) -> tuple[Games, Any]:
        keys = jax.random.split(jax.random.fold_in(key, number), STEPS)

        def one_step(step: Any, carry: tuple[Games, Any]) -> tuple[Games, Any]:
            return collect(game, players, carry[0], starts, keys[step], steps=1)

        # What a step returns overwrites what the one before returned, so all of it is computed.
        return jax.lax.fori_loop(
            0, STEPS, one_step, collect(game, players, under_way, starts, key, steps=1)
        )

    return lambda number: play(under_way, number)


def match(name: str, pursuer: str, evader: str, games: int) -> Run:
    """Play the games of a match."""
    from apollonius.evaluate.match import Match, play_games

    played = Match.of_names(name, pursuer, evader, games)
    return lambda _: play_games(played).outcome


BARRIER = ("fusion_barrier", "fusion_barrier")
SHIELDED = partial(match, "office", "shielded:P_smooth", "still", 64)
ABLATIONS = {
    "barriers": Ablation(BARRIER, without_any, partial(random_play, "paper", 4096)),
    "judge": Ablation(BARRIER, WithoutFor("judge"), partial(random_play, "paper", 4096)),
    "rewards": Ablation(BARRIER, WithoutFor("_rewards"), partial(random_play, "team-3v1", 1024)),
    "rows": Ablation(
        BARRIER, WithoutFor("_concatenate"), partial(random_play, "team-3v1", 1024, "team")
    ),
    "cosine": Ablation(
        BARRIER, WithoutFor("cos_sin"), partial(random_play, "paper", 4096, "encoded")
    ),
    "sight": Ablation(BARRIER, WithoutFor("reaches"), partial(random_play, "lidar", 1024, "paper")),
    "belief": Ablation(
        BARRIER, WithoutFor("visible"), partial(match, "lidar", "search", "still", 64)
    ),
    "words": Ablation(BARRIER, WithoutFor("_words"), partial(random_play, "paper", 4096)),
    "threefry": Ablation(
        ("threefry", "threefry_bits"), plain_bits, partial(random_play, "paper", 4096)
    ),
    "nearby": Ablation(("nearby", "index_nearby"), all_nearby, SHIELDED),
}


def serve(name: str, is_left_out: bool) -> None:
    """Run once for each line on standard input, and print the processor seconds that it took."""
    ablation = ABLATIONS[name]
    module_name, function_name = ablation.form
    module = importlib.import_module(f"apollonius.accelerate.{module_name}")
    if is_left_out:
        setattr(module, function_name, ablation.plain(getattr(module, function_name)))
    run = ablation.workload()
    jax.block_until_ready(run(0))
    if is_left_out and isinstance(ablation.plain, WithoutFor):
        assert ablation.plain.is_met, f"no function {ablation.plain.name}"
    for number, _ in enumerate(sys.stdin):
        start = time.process_time()
        jax.block_until_ready(run(number + 1))
        print(time.process_time() - start, flush=True)


def measure(name: str, turns: int) -> tuple[float, list[float]]:
    """Return the median seconds with the form, and the sorted ratios of those without it."""
    command = [sys.executable, __file__, "--serve", name]

    def server(*flags: str) -> subprocess.Popen[str]:
        pipe = subprocess.PIPE
        return subprocess.Popen([*command, *flags], encoding="utf-8", stdin=pipe, stdout=pipe)

    processes = [server(), server("--without")]

    def turn(process: subprocess.Popen[str]) -> float:
        assert process.stdin
        assert process.stdout
        print(file=process.stdin, flush=True)
        return float(process.stdout.readline())

    pairs = [[turn(process) for process in processes] for _ in range(turns)]
    for process in processes:
        process.communicate()
    ratios = sorted(without / with_form for with_form, without in pairs)
    return statistics.median(pair[0] for pair in pairs), ratios


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", help=f"of {', '.join(ABLATIONS)} (default: all)")
    parser.add_argument("--turns", type=int, default=TURNS, help="(default: %(default)s)")
    parser.add_argument("--serve", choices=ABLATIONS, help=argparse.SUPPRESS)
    parser.add_argument("--without", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.serve:
        serve(options.serve, options.without)
        return
    core = {min(os.sched_getaffinity(0))}
    os.sched_setaffinity(0, core)
    print("form            ms with it   without it: times   middle half")
    for name in options.names or ABLATIONS:
        seconds, ratios = measure(name, options.turns)
        quarter = len(ratios) // 4
        print(
            f"{name:12} {1e3 * seconds:13.1f} {statistics.median(ratios):19.2f}   "
            f"{ratios[quarter]:.2f} to {ratios[-1 - quarter]:.2f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
