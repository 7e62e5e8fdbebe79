"""An agent asked again in recorded states: nothing differs but what was changed. Bags themselves: tests/ros2."""

import jax
import numpy as np
import pytest

from apollonius.arenas.file import find_game
from apollonius.arenas.record import to_dict
from apollonius.export.bag import Bag, ask_again
from apollonius.export.player import find_exportable
from apollonius.game.types import Role
from apollonius.io.errors import InvalidInput


def recorded(name, game, steps):
    """A bag of decisions in states at random, some of them braking, in two games."""
    player, rng = find_exportable(name, Role.PURSUER, game), np.random.default_rng(0)
    decisions, memory, decide = [], player.memory, jax.jit(player.decide)
    for step in range(steps):
        told = {"time": 100 + 0.1 * step, "step": step % 10, "trouble": "late" if step % 4 == 3 else ""}
        if not told["trouble"]:
            states, bits = rng.uniform(1, 4, (player.robots, 4)), int(rng.integers(2**32))
            active = [True] * player.robots
            memory = player.memory if step % 10 == 0 else memory
            given = np.array(active) if player.robots > 2 else None
            made = decide(player.policy, player.game, states.astype(np.float32), given, memory, np.uint32(bits))
            memory = made["memory"]
            told |= {"states": states.tolist(), "active": active, "bits": bits}
            told |= {"controls": np.asarray(made["controls"]).astype(float).tolist()}
        decisions.append(told)
    return Bag(name, Role.PURSUER, to_dict(game), decisions)


@pytest.mark.parametrize(("name", "game"), [("random", "paper"), ("intercept", "team-3v1")])
def test_only_what_was_changed_differs(name, game):
    bag = recorded(name, find_game(game), 20)
    assert ask_again(bag, name, bag.game) == []
    then = bag.decisions[12]["controls"]
    then[1] += 0.1
    assert len(bag.asked) == 15
    (one,) = ask_again(bag, name, bag.game)
    assert (one["time"], one["step"], one["then"]) == (pytest.approx(1.2), 2, then)
    assert one["now"][1] == pytest.approx(then[1] - 0.1)


def test_a_game_of_other_robots_is_refused():
    bag = recorded("intercept", find_game("team-3v1"), 2)
    with pytest.raises(InvalidInput, match=r"robots in the bag = 4 .* 2, as in 1 v 1"):
        ask_again(bag, "intercept", find_game("paper"))
