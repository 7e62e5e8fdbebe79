"""The paper's trainings with many seeds side by side on an accelerator, and every pursuer against
every evader.

    python benchmarks/replication.py --scratch 25 --curriculum 10 --out runs/replication

The functions are those of `apollonius train`, mapped over the seeds; `apollonius reproduce` trains
one seed after another and differs in the last bits of the arithmetic. `counts.json` is written
again after each look at the trainings, a report with the claims at the end; where the counts are
complete, only the report is made.
"""

import argparse
import inspect
import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from apollonius.learn.loop import train_chunk
from apollonius.learn.stage_config import Plan, SelfPlayConfig
from apollonius.learn.train_state import TrainState, start

from apollonius import MatchResult
from apollonius.agents.pool import Pool, single_player
from apollonius.agents.trained import greedy_policy
from apollonius.catalogue import find_player
from apollonius.evaluate.match import match_keys
from apollonius.evaluate.statistics import predict
from apollonius.game.game import Game, sample_starts
from apollonius.game.outcome import counts_by_name
from apollonius.game.types import BySide, Outcome, Role, tree_where
from apollonius.learn.config import FIXED_TARGET, PRESETS, SELF_PLAY, STAGES
from apollonius.play.random_bits import random_bits_of
from apollonius.play.rollout import init_games, step_games
from apollonius.reproduce.finding import (
    Finding,
    Matches,
    markdown_table,
    rates,
    undefeated,
    won,
    write_report,
)
from apollonius.reproduce.reproduction import figure_6, stage_1, table_2, table_3
from apollonius.reproduce.study import MATCH_SEED, Study, run_configs
from apollonius.show import palette, style

_CHUNKS = 32
"""Chunks of a training in a call of the compiled function."""


def train(
    plan: Plan,
    game: Game,
    seeds: Sequence[int],
    fixed: dict[Role, Pool],
    evaluations: int = 8,
    networks: Any = None,
) -> Iterator[tuple[float, dict[Role, Any]]]:
    """Train one stage with all seeds side by side; yield at even intervals the share done [%] and
    the greedy players.

    Args:
        plan: The stage and its learner.
        game: The game.
        seeds: The seeds.
        fixed: Players of sides that do not learn.
        evaluations: Number of intervals.
        networks: First networks of the pursuers, stacked; random ones for None.

    Yields:
        The share [%], and the players by side, stacked over seeds.
    """
    rewarded = plan.stage.trained_in(game)
    stage = SELF_PLAY if isinstance(plan.stage, SelfPlayConfig) else FIXED_TARGET
    keys = jnp.stack(
        [jax.random.fold_in(jax.random.key(seed), STAGES.index(stage)) for seed in seeds]
    )

    def chunk(_: Any, state: TrainState) -> TrainState:
        return inspect.unwrap(train_chunk)(plan, rewarded, state, fixed)[0]

    first = jax.jit(
        jax.vmap(lambda key, network: start(plan, rewarded, key, fixed, BySide(network, None)))
    )
    train_chunks = jax.jit(
        jax.vmap(lambda state: jax.lax.fori_loop(0, _CHUNKS, chunk, state)), donate_argnums=0
    )
    state = first(keys, networks)
    calls = -(-plan.chunks // _CHUNKS)
    start_time = time.time()
    for call in range(1, calls + 1):
        state = train_chunks(state)
        if call * evaluations // calls > (call - 1) * evaluations // calls:
            percent = 100 * (call * evaluations // calls) / evaluations
            players = {
                role: greedy_policy(side.learner.average) for role, side in state.learners.items()
            }
            yield percent, jax.tree.map(jnp.copy, players)
            speed = int(state.env_steps[0]) * len(seeds) / (time.time() - start_time)
            print(
                f"{stage}: {len(seeds)} trainings, {percent:g} %, {speed:,.0f} env steps/s",
                flush=True,
            )


def matches(game: Game, pursuers: Any, evaders: Any, games: int) -> list[list[list[int]]]:
    """Count the games by `Outcome` of every pursuer against every evader.

    Args:
        game: The game.
        pursuers: The pursuers, stacked.
        evaders: The evaders, stacked, or one for all.
        games: Games of each match.
    """
    start_key, key = match_keys(np.uint32(MATCH_SEED))
    ends = np.asarray(
        _outcomes(game, pursuers, evaders, sample_starts(game, start_key, games), key)
    )
    return [[np.bincount(pair, minlength=len(Outcome)).tolist() for pair in row] for row in ends]


@eqx.filter_jit
def _outcomes(game: Game, pursuers: Any, evaders: Any, starts: Any, key: Any) -> Any:
    """Return the outcomes of the games of all pairs, `[pursuers, evaders, games]`."""
    numbers = jnp.arange(len(starts.steps))

    def of_pair(*pair: Any) -> Any:
        players = BySide(*map(single_player, pair))

        def step(carry: tuple[Any, Any]) -> tuple[Any, Any]:
            games, outcome = carry
            bits = random_bits_of(key, numbers, games.state.steps)
            games, transitions = step_games(game, players, games, bits, with_obs=False)
            return games, jnp.where(outcome == Outcome.ONGOING, transitions.outcome, outcome)

        first_games = init_games(
            game, starts, players, random_bits_of(key, numbers, jnp.full_like(numbers, -1))
        )
        ongoing = jnp.full(len(numbers), int(Outcome.ONGOING), jnp.int32)
        return jax.lax.while_loop(
            lambda carry: jnp.any(carry[1] == Outcome.ONGOING), step, (first_games, ongoing)
        )[1]

    # a player without a network has no leaves
    columns = next(map(len, jax.tree.leaves(evaders)), 1)
    against = jax.vmap(of_pair, in_axes=(None, 0), axis_size=columns)
    return jax.vmap(against, in_axes=(0, None))(pursuers, evaders)


def play_all(options: argparse.Namespace, path: Path) -> dict[str, Any]:
    """Train all agents and let them play, write the counts as they come, and return them."""
    configs = run_configs(PRESETS["paper"], 0)
    game = configs["curriculum"].game
    seeds = list(range(options.curriculum))
    scratch = list(range(options.scratch))
    still, uniform = (find_player(name, Role.EVADER, game).policy for name in ("still", "random"))
    results: dict[str, Any] = {
        "games": options.games,
        "share": options.share,
        "device": jax.devices()[0].device_kind,
    }
    results["course"] = []

    def plan_of(run: str, stage: str) -> Plan:
        plan = configs[run].plans[stage]
        return replace(
            plan, stage=replace(plan.stage, env_steps=int(plan.stage.env_steps * options.share))
        )

    def write(**captures: Any) -> None:
        results.update(captures)
        path.write_text(json.dumps(results), encoding="utf-8")

    first, best = plan_of("curriculum", FIXED_TARGET), np.full(len(seeds), -1)
    best_pursuers: Any = None
    for _, agents in train(
        first, game, seeds, {Role.EVADER: single_player(still)}, first.stage.evaluations
    ):
        # Of each seed the pursuer with most captures so far is kept (section IV).
        current = agents[Role.PURSUER]
        captures = np.array(
            [
                row[0][Outcome.CAPTURED]
                for row in matches(game, current, still, first.stage.evaluation_games)
            ]
        )
        best_pursuers = jax.vmap(tree_where)(
            jnp.asarray(captures > best), current, best_pursuers or current
        )
        best = np.maximum(best, captures)
    write(**{"P_stage1 v still": matches(game, best_pursuers, still, options.games)})

    agents_from_scratch = dict(train(plan_of("scratch", SELF_PLAY), game, scratch, {}))
    agents = dict[Role, Any]()
    for percent, agents in train(
        plan_of("curriculum", SELF_PLAY), game, seeds, {}, networks=best_pursuers.network
    ):
        # Agents of the curriculum meet those from scratch that had trained as long.
        scratch_agents = agents_from_scratch[percent]
        games = options.games // (1 if percent == 100 else 2)
        captures = {
            "P_curriculum v E_scratch": matches(
                game, agents[Role.PURSUER], scratch_agents[Role.EVADER], games
            ),
            "P_scratch v E_curriculum": matches(
                game, scratch_agents[Role.PURSUER], agents[Role.EVADER], games
            ),
        }
        write(course=[*results["course"], {"percent": percent, **captures}], **captures)
    write(**{"P_curriculum v random": matches(game, agents[Role.PURSUER], uniform, options.games)})

    ((_, agents),) = train(
        plan_of("random", FIXED_TARGET),
        game,
        seeds,
        {Role.EVADER: single_player(uniform)},
        evaluations=1,
    )
    for name, evader in (("random", uniform), ("E_scratch", agents_from_scratch[100][Role.EVADER])):
        write(**{f"P_random v {name}": matches(game, agents[Role.PURSUER], evader, options.games)})
    return results


@dataclass
class Counted(Study):
    """A study whose matches were played side by side, and its counts."""

    counts: dict[str, Any] = field(default_factory=dict)

    def matches(self, pursuer: str, evader: str) -> Matches:
        return as_matches(self.counts[f"{pursuer} v {evader}"])


def as_matches(counts: list[list[list[int]]]) -> Matches:
    """Return counts of games by outcome as matches, of which nothing else is known."""
    return [[MatchResult(counts_by_name(pair), 0.0, None) for pair in row] for row in counts]


def in_the_course(study: Counted) -> Finding:
    """Draw the claims of Fig. 6 in the course of self-play: means over pairs, and where another
    pair would lie.
    """
    claims = (
        ("P_curriculum wins against E_scratch", "P_curriculum v E_scratch", won, palette.PURSUER),
        (
            "E_curriculum undefeated by P_scratch",
            "P_scratch v E_curriculum",
            undefeated,
            palette.EVADER,
        ),
    )
    percents, cells = [record["percent"] for record in study.counts["course"]], list[list[str]]()
    with style.picture(study.folder / "course.png", width=6.0) as (axes,):
        for claim, name, share, colour in claims:
            predictions = [
                predict(np.array(rates(as_matches(record[name]), share)), 0, 1)
                for record in study.counts["course"]
            ]
            mean, low, high = 100 * np.transpose(
                [(record.mean, *record.interval) for record in predictions]
            )
            axes.fill_between(percents, low, high, color=colour, alpha=0.15, linewidth=0)
            axes.plot(percents, mean, "o-", color=colour, label=claim)
            rows_of_claim = zip(
                mean, low, high, (record.chance(0.7) for record in predictions), strict=True
            )
            cells.append(
                ["{:.1f} [{:.0f}, {:.0f}], {:.0%}".format(*record) for record in rows_of_claim]
            )
        axes.axhline(70, color=palette.INK, linewidth=0.8, linestyle=":")
        axes.set(xlabel="self-play [%]", ylabel="games [%]", ylim=(0, 103))
        axes.set_title(
            "mean of all pairs, and where another would lie with 95 % (dotted: the paper)"
        )
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18), ncols=2)
    rows = [
        [f"{percent:g} %", *cells_of_row]
        for percent, *cells_of_row in zip(percents, *cells, strict=True)
    ]
    text = markdown_table(["self-play", *(claim for claim, *_ in claims)], rows)
    return Finding(
        "Fig. 6 in the course of self-play: mean [95 % prediction], chance of 70 %",
        text,
        ("course.png",),
    )


def main() -> None:
    """Train, play, and write the counts, where they are not complete, and the report."""
    parser = argparse.ArgumentParser(
        description="The paper's trainings with many seeds side by side."
    )
    parser.add_argument("--scratch", type=int, default=25, help="seeds of self-play from scratch")
    parser.add_argument(
        "--curriculum", type=int, default=10, help="seeds of the curriculum and of P_random"
    )
    parser.add_argument(
        "--games", type=int, default=500, help="in a match; half of them in the course of self-play"
    )
    parser.add_argument(
        "--share", type=float, default=1.0, help="of each stage's env steps, to try it out"
    )
    parser.add_argument(
        "--out", type=Path, required=True, help="folder of the counts and the report"
    )
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    path = options.out / "counts.json"
    counts = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    if "P_random v E_scratch" not in counts:  # which is played last
        counts = play_all(options, path)
    seeds = tuple(range(len(counts["P_stage1 v still"])))
    budget = "paper" if counts["share"] == 1 else f"{counts['share']} of paper"
    study = Counted(options.out, budget, seeds, counts["games"], counts=counts)
    first = Finding(
        "Stage 1", "Greedy games.", claims=(stage_1(study.matches("P_stage1", "still")),)
    )
    write_report(
        study,
        [
            first,
            *(make_section(study) for make_section in (in_the_course, figure_6, table_2, table_3)),
        ],
    )


if __name__ == "__main__":
    main()
