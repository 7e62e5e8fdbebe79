"""The pursuers of "Watch it learn": one training of the preset `quick`, stage 1, saved after shares of it.

python -m website.learners
"""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from apollonius.agents.store import describe, save_agent
from apollonius.arenas.file import to_dict
from apollonius.game.types import BySide, Role
from apollonius.learn.config import FIXED_TARGET, PRESETS
from apollonius.learn.folder import create_run, load_checkpoint
from apollonius.learn.run import Run
from apollonius.web.site import LEARNERS

SHARES = (0, 1, 5, 25, 100)
"""Shares of the training [%]; `levels.js` offers the same."""


def main() -> None:
    """Train, stop after each share, and save what has been learned."""
    config = replace(PRESETS["quick"], stages=FIXED_TARGET)
    done = [0.0]
    with TemporaryDirectory() as folder:
        create_run(config, Path(folder))
        for percent in SHARES:
            run = Run(config, Path(folder), lambda _, share: done.append(share), lambda: done[-1] >= percent / 100)  # noqa: B023
            saved = run.start(FIXED_TARGET, BySide(None, None))
            if percent:
                run.execute()
                saved = load_checkpoint(run.checkpoint, saved)
            training = {"command": "python -m website.learners", "env_steps": int(saved.train.env_steps)}
            network = saved.train.learners[Role.PURSUER].learner.average
            agent = describe(network, Role.PURSUER, to_dict(config.game), training)
            save_agent(agent, LEARNERS / f"learner-{percent}.safetensors")
            print(f"after {percent} %: {training['env_steps']:,} env steps", flush=True)


if __name__ == "__main__":
    main()
