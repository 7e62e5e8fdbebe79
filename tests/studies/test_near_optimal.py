"""A near-optimal evader beside the table: which starts either loses, and the pictures."""

from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.trained import TRAINED
from apollonius.evaluate.match import Match, play_match
from apollonius.game.presets import make_game
from apollonius.game.types import GameState, RobotState, Role
from apollonius.solve.kept import joint_problem
from apollonius.solve.solving import solve_problem
from apollonius.solve.store import save_solution
from studies.near_optimal import NearOptimal, _by_concession, _turned

GAME = make_game("paper")


def test_laps_are_counted_only_where_both_go_round_the_same_disc():
    (x, y), angle = (3.0, 3.0), np.linspace(0, 2 * np.pi, 101)

    def round_it(radius, angle):
        nothing = jnp.zeros(len(angle))
        place = jnp.asarray(x + radius * np.cos(angle)), jnp.asarray(y + radius * np.sin(angle))
        return jax.vmap(RobotState)(*place, nothing, nothing)

    def turned(one, other):
        return _turned(GAME, jax.vmap(GameState.of_two)(one, other, jnp.arange(101))).sum()

    assert turned(round_it(1.0, angle), round_it(1.5, angle)) == pytest.approx(4 * np.pi, abs=1e-3)
    assert turned(round_it(1.0, angle), round_it(1.5, -angle)) == pytest.approx(0, abs=1e-3)
    assert turned(round_it(1.0, angle), round_it(2.5, angle)) == 0


def test_starts_are_counted_by_what_the_solved_game_concedes():
    concedes = np.array([-0.3, 0.05, 0.15, 0.15, 0.39, 1.0])
    often = {"agent": np.array([0, 1, 2, 0, 1, 3]), "table": np.array([0, 0, 0, 0, 0, 1])}
    lines = [[cell.strip() for cell in line.split("|")[1:-1]] for line in _by_concession(concedes, often).splitlines()]
    assert lines[0] == ["the solved game concedes", "starts", "lost by agent", "lost by table"]
    assert lines[2:] == [
        ["0 to 0.1", "2", "50.0%", "0.0%"],
        ["0.1 to 0.2", "2", "50.0%", "0.0%"],
        ["0.2 to 0.3", "0", "-", "-"],
        ["0.3 to 0.4", "1", "100.0%", "0.0%"],
        ["0.4 to 1", "1", "100.0%", "100.0%"],
    ]


@pytest.mark.slow
def test_it_says_what_the_matches_do_and_draws(tmp_path, monkeypatch):
    table = tmp_path / "evader.npz"
    save_solution(solve_problem(joint_problem(GAME, Role.EVADER, (5, 5, 3, 4)), GAME), table)
    names = SimpleNamespace(names=lambda: ["P_stage1", "P_pool"], fits=TRAINED.fits)
    monkeypatch.setattr("studies.near_optimal.TRAINED", names)
    study = NearOptimal(out=tmp_path, table=table, agent="E_scratch", hunter="P_pool", games=60)
    finding = study.finding()
    match = play_match(Match.of_names("paper", "P_pool", "E_scratch", 60))
    assert finding.data["lost"]["E_scratch"]["P_pool"] == round(match.pursuer_win_rate * 60)
    lost = finding.data["lost"]["E_scratch"]
    assert max(lost.values()) <= finding.data["lost_to_one_at_least"]["E_scratch"] <= sum(lost.values())
    assert (tmp_path / "near_optimal.png").stat().st_size > 50_000
