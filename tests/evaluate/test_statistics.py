"""How sure a rate is, verdicts that follow from intervals, who is judged against whom, advice, and the regret card."""

import json
import math
from dataclasses import asdict, replace

import jax
import numpy as np
import pytest

from apollonius.agents.classical import Uniform
from apollonius.agents.network import make_actor, make_network
from apollonius.agents.store import describe, save_agent
from apollonius.agents.trained import SquashedMean
from apollonius.benchmark.card import load_card
from apollonius.cli.terminal import advice_table
from apollonius.evaluate import tournament
from apollonius.evaluate.claims import TABLE_2, TABLE_3, Claim
from apollonius.evaluate.match import draw_starts, play_match
from apollonius.evaluate.pairings import last_agents, pairings
from apollonius.evaluate.solved import measure_card
from apollonius.evaluate.statistics import (
    mean_band,
    mean_interval,
    paired_difference_interval,
    predict,
    wilson_interval,
)
from apollonius.game.arena import Arena
from apollonius.game.presets import make_game
from apollonius.game.types import Role
from apollonius.solve.grid import make_grid
from apollonius.solve.joint import make_duel, solve_duel
from apollonius.solve.motion import make_zero_sum_game
from apollonius.solve.players import SaddlePolicy
from tests.acting import a_match
from tests.documents import REPOSITORY
from tests.solve.small import BODY, SMALL

Z = 1.959963984540054
"""Half of the remaining 5 % of a normal distribution lies beyond this many standard deviations."""


@pytest.mark.parametrize(("successes", "trials"), [(0, 7), (1, 3), (9870, 10_000), (10, 10)])
def test_wilson_interval_matches_the_formula(successes, trials):
    rate = successes / trials
    centre = (rate + Z**2 / (2 * trials)) / (1 + Z**2 / trials)
    half = Z / (1 + Z**2 / trials) * math.sqrt(rate * (1 - rate) / trials + Z**2 / (4 * trials**2))
    assert wilson_interval(successes, trials) == pytest.approx((centre - half, centre + half), abs=1e-12)


@pytest.mark.parametrize(("successes", "trials"), [(5, 3), (-1, 10), (0, 0), (0, -1)])
def test_wilson_interval_refuses_impossible_counts(successes, trials):
    with pytest.raises(ValueError, match=r"\d"):
        wilson_interval(successes, trials)


def test_mean_band_and_interval_match_students_t():
    low, high = mean_band(np.array([[1.0, 5.0], [2.0, 5.0], [3.0, 5.0]]))
    reach = 4.302653 / math.sqrt(3)  # of Student's t with 2 degrees of freedom; the standard deviation is 1
    np.testing.assert_allclose(low, [2 - reach, 5], rtol=1e-6)
    np.testing.assert_allclose(high, [2 + reach, 5], rtol=1e-6)
    assert mean_interval([1.0, 2.0, 3.0]) == pytest.approx((2 - reach, 2 + reach))
    assert mean_interval([1.0, 2.0, 3.0], 0.0, 3.0) == (0.0, 3.0)
    assert mean_interval([1.0], 0.0, 3.0) == (0.0, 3.0)
    with pytest.raises(ValueError, match="1 seeds"):
        mean_band(np.zeros((1, 4)))


@pytest.mark.parametrize(("spread", "rest", "size"), [(0.1, 0.05, (3, 3)), (0.02, 0.2, (3, 5))])
def test_prediction_interval_covers_a_new_pair_at_the_stated_rate(spread, rest, size):
    """In 3,000 studies of rows and columns that add up, with a rest; 0.01 is two standard errors of the share."""
    generator, within, variances = np.random.default_rng(1), [], []
    for _ in range(3000):
        rows, columns = (generator.normal(0, spread, one) for one in ((size[0] + 1, 1), (1, size[1] + 1)))
        values = rows + columns + generator.normal(0, rest, (len(rows), columns.size))
        found = predict(values[:-1, :-1], -9.0, 9.0)
        within.append(found.interval[0] <= values[-1, -1] <= found.interval[1])
        variances.append(found.spread**2)
    assert np.mean(within) > 0.94
    true = spread**2 * (2 + 1 / size[0] + 1 / size[1]) + rest**2 * (1 + 1 / (size[0] * size[1]))
    assert 0.97 < np.mean(variances) / true < 1.25, "what is estimated below zero counts as zero"


def test_prediction_from_one_column_matches_students_t():
    values = np.array([[0.6], [0.7], [0.8]])
    found = predict(values, 0.0, 1.0)
    reach = 4.302653 * 0.1 * math.sqrt(4 / 3)
    assert found.interval == pytest.approx((0.7 - reach, 1.0))
    assert found.chance(0.7) == pytest.approx(0.5)
    assert found.chance(0.7 - reach) == pytest.approx(0.975)
    same = predict(np.full((3, 1), 0.5), 0.0, 1.0)
    assert (same.interval, same.chance(0.5), same.chance(0.51)) == ((0.5, 0.5), 1.0, 0.0)
    alone = predict(np.array([[0.6]]), -1.0, 1.0)  # says nothing of another training
    assert (alone.mean, alone.interval, alone.chance(0.5)) == (0.6, (-1.0, 1.0), None)


def test_paired_difference_interval_matches_bonett_and_price():
    """Of 30 pairs 7 differ in one way and 2 in the other; each counts as one more, of 32."""
    first, second = np.arange(30) < 7, np.isin(np.arange(30), (8, 9))
    reach = Z * math.sqrt((8 / 32 + 3 / 32 - (5 / 32) ** 2) / 32)
    assert paired_difference_interval(first, second) == pytest.approx((5 / 32 - reach, 5 / 32 + reach))


@pytest.mark.parametrize(
    ("values", "is_full", "verdict"),
    [
        (((0.99,), (0.985,), (0.98,)), True, "holds"),
        (((0.97,), (0.96,), (0.95,)), True, "undecided"),
        (((0.90,), (0.895,), (0.905,)), True, "does not hold"),
        (((0.99,), (0.985,), (0.98,)), False, "not enough"),
        (((0.99,), (0.985,)), True, "not enough"),
        (((0.9, 0.5, 0.99), (0.95, 0.4, 0.99), (0.92, 0.45, 0.99)), True, "undecided"),
    ],
)
def test_claim_verdict_needs_three_full_trainings_and_the_whole_interval(values, is_full, verdict):
    claim = Claim("rate", "here", 0.5, 0.96, values)
    assert claim.verdict(is_full) == claim.to_dict(is_full)["verdict"] == verdict


def test_claim_data_has_the_mean_interval_and_chance():
    claim = Claim("more", "here", 0.27, 0.1, ((0.3,), (0.1,), (0.2,)), least=-1.0)
    data, found = claim.to_dict(), predict(np.array(claim.values), -1.0, 1.0)
    assert data["mean"] == pytest.approx(0.2)
    assert (data["interval"], data["chance"]) == (found.interval, found.chance(0.1))


def test_tables_of_the_paper_sum_to_500_games():
    counts = [row.values() for table in (TABLE_2, TABLE_3) for row in table.values()]
    assert ({sum(row) for row in counts}, min(map(min, counts))) == ({500}, 0)


@pytest.mark.slow
def test_leaderboard_cards_load_and_are_small():
    for path in (REPOSITORY / "benchmarks" / "leaderboard").glob("*.json"):
        assert path.stat().st_size < 100_000
        load_card(path)


def test_pairings_give_each_pursuer_all_evaders_and_stage_1_a_still_one(tmp_path):
    """Whatever they are called: their files say which side they play."""
    sides = {"foe": Role.EVADER, "chaser": Role.PURSUER, "P_stage1": Role.PURSUER}
    for name, role in sides.items():
        agent = describe(make_network("paper", 4, 1, jax.random.key(0)), role, {}, {})
        save_agent(agent, tmp_path / f"{name}.safetensors")
    assert pairings({name: tmp_path / f"{name}.safetensors" for name in sides}) == [
        ("chaser", "random"),
        ("chaser", "foe"),
        ("P_stage1", "still"),
    ]
    assert pairings({}) == []


def test_last_agents_omits_intermediate_snapshots(tmp_path):
    (tmp_path / "agents").mkdir()
    for name in ("P_scratch", "P_scratch-25", "E_scratch", "P_flee-aware", "P_flee-aware-5"):
        (tmp_path / "agents" / f"{name}.safetensors").touch()
    assert list(last_agents(tmp_path)) == ["E_scratch", "P_flee-aware", "P_scratch"]


@pytest.fixture(scope="module")
def advice():
    short = replace(make_game("paper"), arena=Arena(), max_steps=60)
    with pytest.MonkeyPatch.context() as patch:
        panel = {"pursuer": ("still", "intercept"), "evader": ("still", "random")}
        patch.setattr(tournament, "PANELS", {"full": panel})
        yield tournament.advise(short, 16, seed=1)


def test_advice_chooses_the_best_worst_case_players(advice):
    rates = advice.tournament.win_rates
    assert 0 < rates[1].min() < 1
    assert advice.tournament.pursuers == ("still", "shielded:intercept"), "rules that move are behind a shield"
    assert advice.best.pursuer == "shielded:intercept"
    assert advice.least.pursuer == rates[1].min()
    assert advice.least.evader == 1 - rates[:, ["still", "shielded:random"].index(advice.best.evader)].max()
    assert advice.least.evader == (1 - rates.max(axis=0)).max()


def test_advice_lists_the_pursuer_positions_at_the_time_limit(advice):
    missed = round(16 * (1 - advice.tournament.win_rates[1, 0]))
    assert 0 < len(advice.stops) == min(missed, 8)
    assert np.all((np.array(advice.stops) > 0) & (np.array(advice.stops) < 10))


def test_advice_table_names_players_rates_and_places(advice):
    text = advice_table(advice)
    x, y = advice.stops[0]
    for part in (
        "best pursuer: shielded:intercept, which wins at least",
        f"({x:g}, {y:g})",
        f"{advice.tournament.win_rates[1, 0]:.0%}",
    ):
        assert part in text


QUICK = replace(SMALL, max_steps=150)
GAMES = 60


@pytest.fixture(scope="module")
def tables():
    grid = make_grid(QUICK.arena, BODY, (5, 6, 3, 6))
    games = [make_zero_sum_game(QUICK, (grid, grid), 5, role) for role in Role]
    return [SaddlePolicy(game, solve_duel(make_duel(game)).table) for game in games]


@pytest.mark.slow
@pytest.mark.parametrize("role", Role)
def test_regret_card_matches_the_match_and_the_tables(tables, role):
    """Of a random player, and of one with continuous actions."""
    own, other = tables if role == Role.PURSUER else tables[::-1]
    agent = Uniform() if role == Role.EVADER else SquashedMean(make_actor("encoded", 16, 2, jax.random.key(0)))
    asked = a_match(QUICK, *((agent, other) if role == Role.PURSUER else (other, agent)), GAMES, seed=3)
    card, match, starts = measure_card(asked, own, other), play_match(asked), draw_starts(asked)[0]
    rates = (match.pursuer_win_rate, match.evader_win_rate)
    assert (card.role, card.games) == (role.name.lower(), GAMES)
    assert (card.won, card.lost) == (rates if role == Role.PURSUER else rates[::-1])
    assert card.lost_interval == (match.evader_win_interval if role == Role.PURSUER else match.pursuer_win_interval)
    assert card.promised == pytest.approx(float(np.mean(np.asarray(own.best_value(starts)))))
    assert card.at_most == pytest.approx(-float(np.mean(np.asarray(other.best_value(starts)))))
    assert card.gap == pytest.approx(card.promised - card.payoff, abs=1e-6)
    assert card.gap_interval[0] < card.gap < card.gap_interval[1]
    if role == Role.EVADER:
        assert card.gap_interval[0] > 0.2, "a random evader is far from what the table promises"
    json.dumps(asdict(card))
