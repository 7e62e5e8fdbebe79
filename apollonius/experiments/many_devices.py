"""Self-play on all devices that there are, of one process or of several.

    python -m apollonius.experiments.many_devices --out runs/shared

On several hosts, or in several processes of one, the same with who leads, how many they are, and which this one is:

    python -m apollonius.experiments.many_devices --out runs/shared --coordinator HOST:PORT --processes 2 --process 0

The first process writes `config.toml`, `metrics.jsonl` and both agents. It keeps no checkpoints: stopped, it is lost.
"""

import argparse
import json
import sys
import time
from dataclasses import replace
from pathlib import Path

import jax
import numpy as np

from apollonius.agents.store import describe, save_agent
from apollonius.arenas.record import to_dict
from apollonius.errors import InvalidInput, exit_status, require
from apollonius.game.outcome import counts_by_name
from apollonius.game.types import Role
from apollonius.learn.config import PRESETS, RunConfig
from apollonius.learn.devices import (
    all_devices,
    own_share,
    play_and_learn_shared,
    renew_opponents_shared,
    share,
    start_shared,
)
from apollonius.learn.folder import agent_file, create_run, load_config
from apollonius.learn.run import load_first
from apollonius.learn.state import Plan


def train_shared(config: RunConfig, folder: Path) -> None:
    """Train the stage of self-play of a config on all devices; every process calls this.

    Raises:
        InvalidInput: when the config cannot be shared out between the devices, or the folder holds something already.
    """
    require(config.stages == "self-play", "stages", config.stages, "'self-play', which is what devices share")
    mesh, leads = all_devices(), jax.process_index() == 0
    plan = share(Plan(config.learner, config.self_play), mesh.size)
    if leads:
        create_run(config, folder)
    game, key = plan.stage.rewarded(config.game), jax.random.key(config.seed)
    state = start_shared(mesh, plan, game, key, *(load_first(config, role) for role in Role))
    began = time.monotonic()
    for chunk in range(plan.chunks):
        if plan.renews_after(chunk):
            state = renew_opponents_shared(mesh, plan, game, state)
        state, metrics = play_and_learn_shared(mesh, plan, game, state)
        line = {
            "env_steps": mesh.size * int(own_share(state).env_steps),
            "updates": int(metrics.updates),
            "seconds": round(time.monotonic() - began, 2),
            "outcomes": counts_by_name(np.asarray(metrics.outcomes)),
        }
        if leads:
            with open(folder / "metrics.jsonl", "a") as file:
                file.write(json.dumps(line) + "\n")
    learned = own_share(state)
    for side, role in ((learned.pursuer, Role.PURSUER), (learned.evader, Role.EVADER)):
        assert side is not None, "both sides learn"
        training = {"command": f"{__spec__.name}, {mesh.size} devices", "seed": config.seed, "config": to_dict(config)}
        agent = describe(side.learner.average, role, to_dict(config.game), training)
        if leads:
            save_agent(agent, agent_file(folder, f"{role.name[0]}_shared"))


def main() -> int:
    """Join the other processes, if there are some, and train."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, help="folder of the run")
    parser.add_argument("--config", type=Path, help="a config.toml (default: the preset quick, from P_stage1)")
    parser.add_argument("--coordinator", metavar="HOST:PORT", help="where the first process listens")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--process", type=int, default=0, help="number of this one, from 0")
    options = parser.parse_args()
    try:
        both = bool(options.coordinator) == (options.processes > 1)
        require(both, "--coordinator", options.coordinator, "given if and only if there are several --processes")
        default = replace(PRESETS["quick"], stages="self-play", pursuer="P_stage1")
        config = load_config(options.config) if options.config else default
        if options.coordinator:
            jax.distributed.initialize(options.coordinator, options.processes, options.process)
        train_shared(config, options.out)
    except InvalidInput as error:
        print(f"many_devices: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(exit_status(main))
