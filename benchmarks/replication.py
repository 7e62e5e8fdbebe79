"""The paper's trainings with many seeds side by side on an accelerator, and every pursuer against every evader.

    python benchmarks/replication.py --scratch 25 --curriculum 10 --out replication.json

The functions are those of `apollonius train`, mapped over the seeds; `apollonius reproduce` trains one seed after
another and differs in the last bits of the arithmetic. The file is written again after each look at the trainings.
"""

import argparse
import inspect
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from apollonius.agents.network import QNetwork
from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.pool import Pool, solo
from apollonius.agents.trained import greedy
from apollonius.catalogue import find_player
from apollonius.evaluate.match import keys_of
from apollonius.game.by_side import BySide
from apollonius.game.game import Game, sample_starts
from apollonius.game.outcome import counts_by_name
from apollonius.game.types import Outcome, Role
from apollonius.learn import train_state
from apollonius.learn.config import PRESETS, STAGES
from apollonius.learn.loop import play_and_learn
from apollonius.learn.stage_config import Plan
from apollonius.play.random_bits import random_bits_of
from apollonius.play.rollout import begin, reset_where_done, step_games
from apollonius.reproduce.study import MATCH_SEED, run_configs

_CHUNKS = 32
"""Chunks of a training in a call of the compiled function."""
_CHOICE_GAMES = 1000
"""Games by which the best pursuer of stage 1 is chosen."""
Look = Callable[[int, train_state.TrainState], None]
"""What is done with the states of all trainings at a share of the stage [%]."""


def train(
    plan: Plan, game: Game, stage: str, seeds: Sequence[int], fixed: dict[Role, Pool], look: Look, looks: int = 8,
    networks: Any = None, epsilons: Sequence[float] | None = None,
) -> train_state.TrainState:  # fmt: skip
    """Train one stage with all seeds side by side and return the last states, stacked.

    Args:
        looks: times that `look` is called, evenly.
        networks: pursuers to go on from, stacked; None for random weights.
        epsilons: share of random actions of the pursuer at first, by seed; None for the plan's.
    """
    rewarded = plan.stage.trained_in(game)
    first = jnp.asarray(epsilons or [plan.stage.pursuer_epsilon] * len(seeds), jnp.float32)

    def first_state(key: Any, network: Any) -> train_state.TrainState:
        return train_state.start(plan, rewarded, key, fixed, BySide(network, None))

    @eqx.filter_jit(donate="all-except-first")
    def some(epsilons: Any, state: train_state.TrainState) -> train_state.TrainState:
        def one(epsilon: Any, state: train_state.TrainState) -> train_state.TrainState:
            explored = replace(plan.stage)
            object.__setattr__(explored, "pursuer_epsilon", epsilon)  # a traced number, which no check can read
            own, chunk = Plan(plan.learner, explored), inspect.unwrap(play_and_learn)
            return jax.lax.fori_loop(0, _CHUNKS, lambda _, state: chunk(own, rewarded, state, fixed)[0], state)

        return jax.vmap(one)(epsilons, state)

    state = jax.jit(jax.vmap(first_state))(keys(stage, seeds), networks)
    calls, began = -(-plan.chunks // _CHUNKS), time.time()
    for call in range(1, calls + 1):
        state = some(first, state)
        if call * looks // calls > (call - 1) * looks // calls:
            percent = 100 * (call * looks // calls) // looks
            look(percent, state)
            speed = int(state.env_steps[0]) * len(seeds) / (time.time() - began)
            print(f"{stage}: {len(seeds)} trainings, {percent} %, {speed:,.0f} env steps/s", flush=True)
    return state


def keys(stage: str, seeds: Sequence[int]) -> Any:
    """Return the keys of a stage, one for each seed."""
    return jnp.stack([jax.random.fold_in(jax.random.key(seed), STAGES.index(stage)) for seed in seeds])


def averages(state: train_state.TrainState, role: Role) -> Any:
    """Return copies of the networks that are evaluated, stacked."""
    return jax.tree.map(jnp.copy, state.learners[role].learner.average)


def matches(game: Game, pursuers: QNetwork, evaders: QNetwork | AbstractPolicy, games: int) -> list[list[Any]]:
    """Return the counts of outcomes of every pursuer against every evader, both stacked, or against one for all."""
    start_key, key = keys_of(np.uint32(MATCH_SEED))
    ends = np.asarray(_outcomes(game, pursuers, evaders, sample_starts(game, start_key, games), key))
    return [[counts_by_name(np.bincount(of_pair, minlength=len(Outcome))) for of_pair in row] for row in ends]


@eqx.filter_jit
def _outcomes(game: Game, pursuers: Any, evaders: Any, starts: Any, key: Any) -> Any:
    """Return the outcomes of the games of all pairs, `[pursuers, evaders, games]`."""
    numbers = jnp.arange(len(starts.steps))

    def of_pair(*pair: Any) -> Any:
        players = BySide(*(solo(greedy(one) if isinstance(one, QNetwork) else one) for one in pair))

        def step(carry: tuple[Any, Any]) -> tuple[Any, Any]:
            games, outcome = carry
            bits = random_bits_of(key, numbers, games.state.steps)
            games, played = step_games(game, players, games, bits, observes=False)
            return games, jnp.where(outcome == Outcome.ONGOING, played.outcome, outcome)

        begun = begin(game, starts, players, random_bits_of(key, numbers, jnp.full_like(numbers, -1)))
        ongoing = jnp.full(len(numbers), int(Outcome.ONGOING), jnp.int32)
        return jax.lax.while_loop(lambda carry: jnp.any(carry[1] == Outcome.ONGOING), step, (begun, ongoing))[1]

    columns = len(jax.tree.leaves(evaders)[0]) if isinstance(evaders, QNetwork) else 1
    against = jax.vmap(of_pair, in_axes=(None, 0), axis_size=columns)  # a player without a network has no leaves
    return jax.vmap(against, in_axes=(0, None))(pursuers, evaders)


def main() -> None:
    """Train, play, and write the counts."""
    parser = argparse.ArgumentParser(description="The paper's trainings with many seeds side by side.")
    parser.add_argument("--scratch", type=int, default=25, help="seeds of self-play from scratch")
    parser.add_argument("--curriculum", type=int, default=10, help="seeds of the curriculum and of P_random")
    parser.add_argument("--games", type=int, default=500, help="in a match; half of them in the course of self-play")
    parser.add_argument("--share", type=float, default=1.0, help="of each stage's env steps, to try it out")
    parser.add_argument("--out", type=Path, required=True, help="file of the counts")
    asked = parser.parse_args()
    configs = run_configs(PRESETS["paper"], 0)
    game, seeds, scratch = configs["curriculum"].game, list(range(asked.curriculum)), list(range(asked.scratch))
    still, uniform = (find_player(name, Role.EVADER, game).policy for name in ("still", "random"))
    results: dict[str, Any] = {"games": asked.games, "share": asked.share, "scratch": scratch, "curriculum": seeds}
    results |= {"device": jax.devices()[0].device_kind, "course": []}
    networks: dict[str, Any] = {}

    def plan_of(run: str, stage: str) -> Plan:
        plan = configs[run].plans[stage]
        return replace(plan, stage=replace(plan.stage, env_steps=int(plan.stage.env_steps * asked.share)))

    def write(**found: Any) -> None:
        results.update(found)
        asked.out.write_text(json.dumps(results, indent=1))

    best = np.full(len(seeds), -1)

    def choose(_: int, state: train_state.TrainState) -> None:
        """Keep the pursuer of each seed that has most captures so far (section IV)."""
        new = averages(state, Role.PURSUER)
        found = np.array([row[0]["captured"] for row in matches(game, new, still, _CHOICE_GAMES)])
        better, old = found > best, networks.get("P_stage1", new)
        best[better] = found[better]
        networks["P_stage1"] = jax.vmap(reset_where_done)(jnp.asarray(better), new, old)

    def cross(percent: int, state: train_state.TrainState) -> None:
        """Play agents of the curriculum against those from scratch, as they are now."""
        for role in Role:
            both = averages(state, role)
            networks[f"{role.name[0]}_scratch"] = jax.tree.map(lambda leaf: leaf[: len(scratch)], both)
            networks[f"{role.name[0]}_curriculum"] = jax.tree.map(lambda leaf: leaf[len(scratch) :], both)
        games = asked.games // (1 if percent == 100 else 2)
        pairs = ("P_curriculum", "E_scratch"), ("P_scratch", "E_curriculum")
        found = {f"{one} v {other}": matches(game, networks[one], networks[other], games) for one, other in pairs}
        results["course"].append({"percent": percent, "games": games, **found})
        write()

    first = plan_of("curriculum", "fixed-target")
    train(first, game, "fixed-target", seeds, {Role.EVADER: solo(still)}, choose, first.stage.evaluations)
    write(**{"P_stage1 v still": matches(game, networks["P_stage1"], still, asked.games)})

    # Self-play of both kinds at once: from scratch a pursuer has random weights, and explores more.
    plan, explores = plan_of("scratch", "self-play"), plan_of("curriculum", "self-play").stage.pursuer_epsilon

    def fresh(key: Any) -> Any:
        return train_state.start(plan, game, key, {}).learners[Role.PURSUER].learner.average

    both = jax.jit(jax.vmap(fresh))(keys("self-play", scratch)), networks["P_stage1"]
    begun = jax.tree.map(lambda *leaves: jnp.concatenate(leaves), *both)
    epsilons = [plan.stage.pursuer_epsilon] * len(scratch) + [explores] * len(seeds)
    train(plan, game, "self-play", scratch + seeds, {}, cross, networks=begun, epsilons=epsilons)
    write(**{"P_curriculum v random": matches(game, networks["P_curriculum"], uniform, asked.games)})

    fixed = {Role.EVADER: solo(uniform)}
    last = train(plan_of("random", "fixed-target"), game, "fixed-target", seeds, fixed, lambda percent, state: None)
    chasing = averages(last, Role.PURSUER)
    for name, evader in (("random", uniform), ("E_scratch", networks["E_scratch"])):
        write(**{f"P_random v {name}": matches(game, chasing, evader, asked.games)})


if __name__ == "__main__":
    main()
