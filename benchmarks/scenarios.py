"""The scenarios of the benchmark: proofs of their lines, and the agents that solve them: `python
benchmarks/scenarios.py OUT`.

A line is proved against every reply that holds its actions for as long as the line does (0.5 s), by
exhaustive search in the game's own rules: the other side may change its action at the end of each
hold only. Agents play against coarser replies. Some 15 minutes of a core, the proofs alone
(`--agents` without a name) two.
"""

import argparse
import json
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int

from apollonius.benchmark.scenarios import (
    FOLDER,
    NAMES,
    BenchmarkScenario,
    find_scenarios,
    load_scenario,
    play_scenarios,
)
from apollonius.export.player import exported_side
from apollonius.game.game import Game
from apollonius.game.types import NUM_ACTIONS, BySide, GameState, Outcome, Role, tree_where
from apollonius.io.errors import require

_PURSUERS = "pure-pursuit intercept shielded:intercept pursuer shielded:pursuer P_curriculum"
_EVADERS = "hide flee flee-aware shielded:flee-aware evader shielded:evader E_curriculum"
AGENTS = [*_PURSUERS.split(), *_EVADERS.split()]
"""Rules and agents of the zoo, which play one side each."""
_TOGETHER = 2**14
"""States from which all nine actions are played at a time."""
MOST_STATES = 2**24
"""Most states of games under way that are stored [128 bytes each]."""


@dataclass(frozen=True)
class Proof:
    """A line played against all replies.

    Attributes:
        replies: number of replies.
        holds: number of holds played: equal states of undecided games are played on once.
        refutation: the actions of a reply that the line does not win against; None for a proof.
    """

    replies: int
    holds: int
    refutation: tuple[int, ...] | None


def prove(scenario: BenchmarkScenario, hold: int) -> Proof:
    """Play the line of a scenario against every reply.

    Args:
        scenario: The scenario, whose other side has one robot.
        hold: Control steps for which replies hold each action.

    Raises:
        InvalidInput: For a hold that does not divide the time limit, and where more than
            `MOST_STATES` states are to be stored.
    """
    game = scenario.game
    steps = int(game.max_steps)
    name = f"scenario '{scenario.name}'"
    require(steps % hold == 0, f"{name}: hold", hold, f"a divisor of {steps} steps")
    opponents = len(game.bodies[scenario.role.other])
    require(opponents == 1, f"{name}: robots that reply", opponents, "1")
    line = np.repeat(np.array(scenario.line, np.int32).T, scenario.hold, axis=0)
    states = jax.tree.map(lambda leaf: np.asarray(leaf)[None], scenario.start)
    replies = np.zeros(1, np.int64)  # numbers in base nine, a digit for each hold
    holds = 0
    for number in range(steps // hold):
        if not len(replies):
            break
        own = jnp.asarray(line[number * hold : (number + 1) * hold])
        holds += NUM_ACTIONS * len(replies)
        bound = f"at most {MOST_STATES:,}; let replies hold longer"
        require(holds <= MOST_STATES, f"{name}: states", holds, bound)
        states, outcomes = _play_hold(game, scenario.role, states, own)
        replies = (NUM_ACTIONS * replies[:, None] + np.arange(NUM_ACTIONS)).ravel()
        is_ongoing = outcomes == Outcome.ONGOING
        is_lost = ~is_ongoing & ~scenario.wins(outcomes)
        if is_lost.any():
            digits = np.base_repr(replies[is_lost][0], NUM_ACTIONS).zfill(number + 1)
            return Proof(NUM_ACTIONS ** (steps // hold), holds, tuple(map(int, digits)))
        undecided = np.flatnonzero(is_ongoing)
        distinct = _first_of_equals(_rows(states, undecided))
        states = _rows(states, undecided[distinct])
        replies = replies[undecided[distinct]]
    return Proof(NUM_ACTIONS ** (steps // hold), holds, None)


def _play_hold(
    game: Game, role: Role, states: GameState, own: Int[Array, "steps robots"]
) -> tuple[GameState, Int[np.ndarray, " games"]]:
    """Play a hold of all nine replies from each state.

    Args:
        game: The rules.
        role: The side of the own actions.
        states: Leaves `[n]`.
        own: Its actions in each step.

    Returns the states after it, leaves `[9 n]`, and the outcomes.
    """
    count = len(states.steps)
    parts = []
    together = min(_TOGETHER, 2 ** (count - 1).bit_length())
    for first in range(0, count, together):
        rows = np.minimum(np.arange(first, first + together), count - 1)
        part = _nine_replies(game, role, _rows(states, rows), own)
        parts.append(jax.device_get(part))
    joined = jax.tree.map(lambda *leaves: np.concatenate(leaves)[:count], *parts)
    return jax.tree.map(lambda leaf: leaf.reshape(-1), joined)


@partial(jax.jit, static_argnames="role")
def _nine_replies(
    game: Game, role: Role, states: GameState, own: Int[Array, "steps robots"]
) -> tuple[GameState, Int[Array, "games 9"]]:
    def hold(state: GameState, reply: Int[Array, ""]) -> tuple[GameState, Int[Array, ""]]:
        def one_step(
            before: tuple[GameState, Int[Array, ""]], actions: Int[Array, " robots"]
        ) -> tuple[tuple[GameState, Int[Array, ""]], None]:
            state, outcome = before
            after = game.step(state, *BySide.of(role, tuple(actions), (reply,)))
            is_over = outcome != Outcome.ONGOING
            return tree_where(is_over, before, (after.state, after.outcome)), None

        start = state, jnp.full((), Outcome.ONGOING, jnp.int32)
        return jax.lax.scan(one_step, start, own)[0]

    each_reply = jax.vmap(hold, (None, 0))
    return jax.vmap(each_reply, (0, None))(states, jnp.arange(NUM_ACTIONS))


def _rows(states: GameState, rows: Int[np.ndarray, " few"]) -> GameState:
    return jax.tree.map(lambda leaf: leaf[rows], states)


def _first_of_equals(states: GameState) -> Int[np.ndarray, " few"]:
    """Return the rows of states, leaves `[n]`, without those equal to an earlier one."""
    columns = [np.asarray(leaf).view(np.uint32) for leaf in jax.tree.leaves(states)]
    varied = [column for column in columns if (column != column[:1]).any()]
    if not varied:
        return np.arange(min(len(columns[0]), 1))
    order = np.lexsort(varied)
    is_new = np.zeros(len(order), bool)
    is_new[:1] = True
    for column in varied:
        is_new[1:] |= column[order][1:] != column[order][:-1]
    return order[is_new]


def proof_of(name: str) -> dict[str, object]:
    """Prove a scenario's line; raises SystemExit where a reply beats it."""
    scenario = load_scenario(FOLDER / f"{name}.json")
    began = time.process_time()
    proof = prove(scenario, scenario.hold)
    if proof.refutation is not None:
        raise SystemExit(f"{name}: the reply {proof.refutation} beats the line")
    dt = float(scenario.game.dt)
    return {
        "scenario": name,
        "goal": scenario.goal,
        "line": scenario.line,
        "seconds of a hold": round(scenario.hold * dt, 3),
        "replies": proof.replies,
        "holds played": proof.holds,
        "seconds of a hold of the replies to agents": round(scenario.coarse_hold * dt, 3),
        "processor seconds": round(time.process_time() - began, 1),
    }


def wins_of(agent: str) -> dict[str, str]:
    """Return the number of replies that an agent wins against in each scenario of its side."""
    results = play_scenarios(agent, find_scenarios(exported_side(agent)))
    return {result.scenario: f"{result.won} of {result.replies}" for result in results}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--agents", nargs="*", default=AGENTS, help="(default: all)")
    options = parser.parse_args()
    record: dict[str, object] = {"command": "python benchmarks/scenarios.py OUT"}
    record["proofs"] = [proof_of(name) for name in NAMES]
    wins = dict[str, dict[str, str]]()
    record["games won against replies"] = wins
    for agent in options.agents:
        wins[agent] = wins_of(agent)
        print(agent, wins[agent], flush=True)
        options.out.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    options.out.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
