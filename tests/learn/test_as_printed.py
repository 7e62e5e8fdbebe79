"""The paper's algorithms as an example writes them, line by line, train the weights of the package, bit for bit.

Compilers fuse a product and a sum, which saves a rounding, in some programs and not in others. A process of its own
computes here without such instructions, so that the same formula has the same bits in both.
"""

import os
import platform
import runpy
import subprocess
import sys
from dataclasses import replace

import jax
import numpy as np
import pytest

from apollonius.learn import algorithm
from apollonius.learn.config import FIXED_TARGET, SELF_PLAY, RunConfig, with_profile
from tests.documents import REPOSITORY

SEED, STEPS, UPDATES = 3, 1_300, 1_000
NUMBERS = {
    "width": 16, "learning_starts": STEPS - UPDATES + 1, "target_period": 300, "exploration_steps": 1_000,
}  # fmt: skip
CAPACITY = 700
"""Less than the steps, so that the buffers run full."""


def trained_by_the_package(stage):
    """Return the learners of a chunk of one stage of the profile `paper`."""
    algorithm._CHUNK_ENV_STEPS = STEPS
    config = with_profile(RunConfig(seed=SEED), "paper")
    numbers = replace(config.algorithm, **NUMBERS, replay_capacity=CAPACITY)
    trained = config.by_name[stage].make(numbers, config.game)
    key = jax.random.fold_in(jax.random.key(SEED), config.stage_number(stage))
    state = jax.jit(type(trained).init)(trained, key)
    state, _ = trained.step(state)
    return [side.learner for side in state.learners.values()]


def trained_by_the_example(stage):
    """Return the network and the target of each side."""
    script = runpy.run_path(str(REPOSITORY / "examples" / "as_printed.py"))
    script["algorithm_1"].__globals__["CHUNK"] = STEPS
    numbers = script["Numbers"](**NUMBERS, capacity=CAPACITY)
    if stage == FIXED_TARGET:
        return [script["algorithm_1"](SEED, STEPS, numbers)]
    return list(zip(*script["algorithm_2"](SEED, STEPS, numbers), strict=True))


@pytest.mark.slow
@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="only there can XLA do without fusing")
@pytest.mark.parametrize("stage", [FIXED_TARGET, SELF_PLAY])
def test_the_example_trains_the_weights_of_the_package_bit_for_bit(stage):
    flags = f"{os.environ.get('XLA_FLAGS', '')} --xla_cpu_max_isa=AVX"
    command = [sys.executable, "-m", "tests.learn.test_as_printed", stage]
    subprocess.run(command, check=True, cwd=REPOSITORY, env={**os.environ, "XLA_FLAGS": flags})


def compare(stage):
    learners, sides = trained_by_the_package(stage), trained_by_the_example(stage)
    for learner, side in zip(learners, sides, strict=True):
        assert learner.updates == UPDATES
        for network, theta in zip((learner.network, learner.target), side, strict=True):
            for layer, (weight, bias) in zip(network.layers, theta, strict=True):
                np.testing.assert_array_equal(layer.weight, weight)
                np.testing.assert_array_equal(layer.bias, bias)
        assert not np.array_equal(learner.network.layers[0].weight, learner.target.layers[0].weight)


if __name__ == "__main__":
    compare(sys.argv[1])
