"""How long one decision takes: `python benchmarks/decision.py [--agent P_pool] [--calls 20000]`.

From the raw state of both robots to controls, one at a time, called from Python: the package's own
player compiled with JAX, and the policy as ONNX, as a NumPy file, and as C through ctypes with `-O3` and with
`-O3 -march=native`. Beside them the network alone in onnxruntime, which has neither observation nor controls, with
several settings, of which the fastest counts. They take turns, in states of real games.
Needs gcc and the extra `export`.
"""

import argparse
import json
import tempfile
from collections.abc import Callable
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from apollonius.adapters.export import c, onnx
from apollonius.adapters.export import numpy as numpy_file
from apollonius.adapters.export.blueprint import Blueprint, make_blueprint
from apollonius.adapters.export.parity import Answer, Decide, compare, largest_difference, microseconds
from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.trained import find_trained, greedy
from apollonius.arenas.charting import charted
from apollonius.arenas.file import find_game
from apollonius.evaluate.decisions import Decisions, decisions
from apollonius.game.dynamics import is_continuous
from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.observe.view import look
from apollonius.replay import as_state

STATES = 10_000
NETWORKS: dict[str, dict[str, str]] = {
    "the network alone": {},
    "the network alone, weights as they are": {"session.disable_prepacking": "1"},
    "the network alone, denormals as zero": {"session.set_denormal_as_zero": "1"},
}
"""Settings of onnxruntime for the bare network; the fastest of them is what all else is measured by."""


def in_jax(game: Game, role: Role, player: AbstractPolicy) -> Decide:
    """The package's player, from the state on; its weights are constants of the compiled function."""

    @jax.jit
    def play(state: jax.Array) -> jax.Array:
        rows = state if role == Role.PURSUER else jnp.roll(state, 4)
        seen = player.observation(look(game, as_state(rows, jnp.asarray(0)), role))
        action = player(seen, jnp.uint32(0))
        body = game.body(role)
        said = [] if is_continuous(action) else [action.astype(jnp.float32)]
        return jnp.stack([*said, *body.controls(action)])

    def decide(state: np.ndarray) -> Answer:
        *action, u1, u2 = np.asarray(play(state)).tolist()
        return (int(action[0]), u1, u2) if action else (u1, u2)

    return decide


def exported(blueprint: Blueprint) -> dict[str, Decide]:
    """The policy in every format, written and loaded again."""
    with tempfile.TemporaryDirectory() as folder:
        outs = {format_: Path(folder) / f"policy{format_.SUFFIX}" for format_ in (onnx, numpy_file, c)}
        for format_, out in outs.items():
            for path, content in format_.make_files(blueprint, out).items():
                path.write_bytes(content)
        return {
            "onnx": onnx.load(outs[onnx]),
            "numpy": numpy_file.load(outs[numpy_file]),
            "c -O3": c.load(outs[c]),
            "c -O3 -march=native": c.load(outs[c], (*c.FLAGS, "-march=native")),
        }


def differences(decide: Decide, blueprint: Blueprint, played: Decisions) -> dict[str, float]:
    """From the package's player: other actions, or the largest difference of controls as a share of their largest."""
    if blueprint.continuous:
        return {"largest_difference": largest_difference(decide, blueprint, played.states, played.actions)}
    parity = compare(decide, blueprint, played.states, played.observations, played.actions)
    return {"ties": parity.ties, "errors": parity.errors}


def main() -> None:
    """Measure, and print a line of JSON for each."""
    parser = argparse.ArgumentParser(description="How long one decision takes.")
    parser.add_argument("--agent", default="P_pool")
    parser.add_argument("--game", default="paper")
    parser.add_argument("--calls", type=int, default=20_000)
    options = parser.parse_args()
    agent, path = find_trained(options.agent)
    player = greedy(agent.network)
    game, role = find_game(options.game), Role[agent.header.role.upper()]
    blueprint = make_blueprint(path.stem, agent, game)
    if blueprint.charted:
        game = charted(game)
    played = decisions(game, player, role, STATES)
    deciders = {"jax": in_jax(game, role, player), **exported(blueprint)}
    network: dict[str, Callable[[np.ndarray], object]] = {
        name: onnx.load_network(blueprint, entries) for name, entries in NETWORKS.items()
    }
    states = dict.fromkeys(deciders, played.states) | dict.fromkeys(network, played.observations)
    times = microseconds(network | deciders, states, options.calls)
    fastest = min(float(np.median(times[name])) for name in NETWORKS)
    for name, taken in times.items():
        median, late = np.percentile(taken, (50, 99)).tolist()
        row = {"what": name, "median_us": round(median, 1), "p99_us": round(late, 1)}
        row |= {"median_of_fastest_network": round(median / fastest, 2)}
        if name in deciders:
            row |= differences(deciders[name], blueprint, played)
        print(json.dumps(row))


if __name__ == "__main__":
    main()
