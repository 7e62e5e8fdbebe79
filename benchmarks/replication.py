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
from typing import Any, cast

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
from apollonius.learn.config import FIXED_TARGET, PRESETS, SELF_PLAY, STAGES
from apollonius.learn.loop import play_and_learn
from apollonius.learn.stage_config import Plan, SelfPlayConfig
from apollonius.learn.train_state import TrainState, start
from apollonius.play.random_bits import random_bits_of
from apollonius.play.rollout import begin, reset_where_done, step_games
from apollonius.reproduce.study import MATCH_SEED, run_configs

_CHUNKS = 32
"""Chunks of a training in a call of the compiled function."""
Look = Callable[[int, dict[Role, Any]], None]
"""What is done at a share of a stage [%] with the networks that are evaluated, stacked, by side."""


def train(
    plan: Plan, game: Game, seeds: Sequence[int], fixed: dict[Role, Pool], look: Look, looks: int = 8,
    networks: Any = None,
) -> None:  # fmt: skip
    """Train one stage with all seeds side by side, and look at it evenly; `networks` are pursuers to go on from."""
    rewarded, stage = plan.stage.trained_in(game), SELF_PLAY if isinstance(plan.stage, SelfPlayConfig) else FIXED_TARGET
    keys = jnp.stack([jax.random.fold_in(jax.random.key(seed), STAGES.index(stage)) for seed in seeds])

    def first_state(key: Any, network: Any) -> TrainState:
        return start(plan, rewarded, key, fixed, BySide(network, None))

    @eqx.filter_jit(donate="all")
    def some(state: TrainState) -> TrainState:
        def chunk(_: Any, state: TrainState) -> TrainState:
            return inspect.unwrap(play_and_learn)(plan, rewarded, state, fixed)[0]

        return jax.vmap(lambda state: jax.lax.fori_loop(0, _CHUNKS, chunk, state))(state)

    state, calls, began = jax.jit(jax.vmap(first_state))(keys, networks), -(-plan.chunks // _CHUNKS), time.time()
    for call in range(1, calls + 1):
        state = some(state)
        if call * looks // calls > (call - 1) * looks // calls:
            percent = 100 * (call * looks // calls) // looks
            look(percent, {role: jax.tree.map(jnp.copy, one.learner.average) for role, one in state.learners.items()})
            speed = int(state.env_steps[0]) * len(seeds) / (time.time() - began)
            print(f"{stage}: {len(seeds)} trainings, {percent} %, {speed:,.0f} env steps/s", flush=True)


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
    untaught, taught = dict[int, Any](), dict[Role, Any]()
    best, chosen = np.full(len(seeds), -1), cast(Any, None)

    def plan_of(run: str, stage: str) -> Plan:
        plan = configs[run].plans[stage]
        return replace(plan, stage=replace(plan.stage, env_steps=int(plan.stage.env_steps * asked.share)))

    def write(**found: Any) -> None:
        results.update(found)
        asked.out.write_text(json.dumps(results, indent=1))

    def choose(_: int, networks: dict[Role, Any]) -> None:
        """Keep the pursuer of each seed that has most captures so far (section IV)."""
        nonlocal chosen
        new = networks[Role.PURSUER]
        found = np.array([row[0]["captured"] for row in matches(game, new, still, first.stage.evaluation_games)])
        chosen = jax.vmap(reset_where_done)(jnp.asarray(found > best), new, chosen or new)
        np.maximum(best, found, out=best)

    def cross(percent: int, networks: dict[Role, Any]) -> None:
        """Play agents of the curriculum against those from scratch that had trained as long."""
        taught.update(networks)
        others, games = untaught[percent], asked.games // (1 if percent == 100 else 2)
        found = {
            "P_curriculum v E_scratch": matches(game, networks[Role.PURSUER], others[Role.EVADER], games),
            "P_scratch v E_curriculum": matches(game, others[Role.PURSUER], networks[Role.EVADER], games),
        }
        write(course=[*results["course"], {"percent": percent, "games": games, **found}])

    def compare(_: int, networks: dict[Role, Any]) -> None:
        """Play the pursuers that learned to catch a random evader."""
        for name, evader in (("random", uniform), ("E_scratch", untaught[100][Role.EVADER])):
            write(**{f"P_random v {name}": matches(game, networks[Role.PURSUER], evader, asked.games)})

    first, second = plan_of("curriculum", FIXED_TARGET), plan_of("curriculum", SELF_PLAY)
    train(first, game, seeds, {Role.EVADER: solo(still)}, choose, first.stage.evaluations)
    write(**{"P_stage1 v still": matches(game, chosen, still, asked.games)})
    train(plan_of("scratch", SELF_PLAY), game, scratch, {}, untaught.__setitem__)
    train(second, game, seeds, {}, cross, networks=chosen)
    write(**{"P_curriculum v random": matches(game, taught[Role.PURSUER], uniform, asked.games)})
    train(plan_of("random", FIXED_TARGET), game, seeds, {Role.EVADER: solo(uniform)}, compare, 1)


if __name__ == "__main__":
    main()
