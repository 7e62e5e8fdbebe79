"""Train outside agents at an equal budget: both sides, some seeds, files that exist are kept.

    python -m benchmarks.entrants.train sb3-ppo --out FOLDER

The libraries: pip install stable-baselines3 skrl rejax tfp-nightly open_spiel tianshou. Rejax 0.1.3
needs the nightly TensorFlow Probability for JAX 0.10.
"""

import argparse
import importlib
import os
import time
from importlib.metadata import version
from pathlib import Path

from apollonius import Role, save_agent
from benchmarks.entrants.game import ENV_STEPS, agent_of, make_games

LEARNERS = {
    "sb3-ppo": ("sb3", "ppo", "stable_baselines3"),
    "sb3-dqn": ("sb3", "dqn", "stable_baselines3"),
    "sb3-a2c": ("sb3", "a2c", "stable_baselines3"),
    "spiel-ppo": ("spiel", "ppo", "open_spiel"),
    "rejax-ppo": ("rejaxed", "ppo", "rejax"),
    "rejax-dqn": ("rejaxed", "dqn", "rejax"),
    "skrl-ppo": ("skrled", "ppo", "skrl"),
    "skrl-dqn": ("skrled", "dqn", "skrl"),
    "tianshou-dqn": ("tianshoued", "dqn", "tianshou"),
}
"""By name: module, function and library."""


def file_of(learner: str, role: Role, seed: int) -> str:
    """Return the name of an agent's file."""
    return f"{learner}-{role.name.lower()}-{seed}.safetensors"


def train(learner: str, role: Role, seed: int, folder: Path) -> None:
    """Train an agent, unless its file exists, and write it."""
    path = folder / file_of(learner, role, seed)
    if path.exists():
        return
    module, function, library = LEARNERS[learner]
    learn = getattr(importlib.import_module(f"benchmarks.entrants.{module}"), function)
    make_games(role)
    start = time.process_time()
    layers = learn(role, seed)
    seconds = time.process_time() - start
    training = {
        "library": f"{library} {version(library)}",
        "seed": seed,
        "env steps": ENV_STEPS,
        "processor seconds": round(seconds, 1),
    }
    save_agent(agent_of(layers, role, training), path)
    print(f"{path.stem}: {seconds:.0f} processor seconds", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("learners", nargs="+", choices=LEARNERS)
    parser.add_argument("--seeds", type=int, default=3, help="how many (default: %(default)s)")
    parser.add_argument("--out", type=Path, required=True, help="folder of the agents")
    options = parser.parse_args()
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    options.out.mkdir(parents=True, exist_ok=True)
    for seed in range(options.seeds):
        for learner in options.learners:
            for role in Role:
                train(learner, role, seed, options.out)


if __name__ == "__main__":
    main()
