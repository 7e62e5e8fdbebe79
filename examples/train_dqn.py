"""Train a pursuer to catch an evader that stands still (stage 1) by DQN, and plot its curve.

    pip install -e '.[plot]'
    python examples/train_dqn.py

About a minute of a core. It writes the run's folder and curve.png, and prints an evaluation a line:

     1,007,616 env steps:   0.0 % captured
     2,007,040 env steps:  19.6 % captured
     3,006,464 env steps:  62.8 % captured
     4,005,888 env steps:  92.0 % captured
     5,005,312 env steps:  95.8 % captured
     6,004,736 env steps:  96.2 % captured
     7,004,160 env steps:  98.0 % captured
     8,003,584 env steps:  98.4 % captured
"""

from dataclasses import replace
from pathlib import Path

from matplotlib.figure import Figure

from apollonius.learn.config import PRESETS
from apollonius.learn.folder import create_run
from apollonius.learn.metrics import load_metrics
from apollonius.learn.run import TrainingRun


def main(env_steps: int = 8_000_000, games: int = 500, out: str = "runs/chase", **dqn: int) -> None:
    """Train in a new folder; `dqn` are other numbers of the learner, such as `width=64`."""
    preset = PRESETS["quick"]
    stage_1 = replace(preset.stages[0], env_steps=env_steps, evaluation_games=games)
    learner = replace(preset.algorithm, **dqn)
    config = replace(preset, stages=(stage_1,), algorithm=learner)

    folder = Path(out)
    create_run(config, folder)
    TrainingRun(config, folder).execute()

    lines = load_metrics(folder / "metrics.jsonl")
    evaluations = [line.evaluation for line in lines if line.evaluation]
    steps = [evaluation.env_steps for evaluation in evaluations]
    rates = [100 * evaluation.outcomes["captured"] / games for evaluation in evaluations]
    for step, rate in zip(steps, rates, strict=True):
        print(f"{step:10,} env steps: {rate:5.1f} % captured")

    figure = Figure(layout="constrained")
    axes = figure.subplots()
    axes.plot(steps, rates, marker="o")
    axes.set(xlabel="env steps", ylabel="standing evaders captured [%]")
    figure.savefig("curve.png")


if __name__ == "__main__":
    main()
