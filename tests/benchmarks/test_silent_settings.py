"""The posterior of settings on which the paper is silent, by outcomes of which the settings are known."""

import math
from dataclasses import astuple

import numpy as np
import pytest


def outcomes_at(benchmark, settings, random):
    """Outcomes whose logarithms depend on the time step and the number of discs alone, and on chance."""
    slopes = np.random.default_rng(7).normal(size=(4, 6, 2))
    drive = np.array([math.log(settings.dt / 0.122) / 0.9, (settings.discs - 3) / 2])
    shares = np.exp(2 * slopes @ drive + random.normal(0, 0.1, (4, 6)))
    counts = (random.multinomial(2000, row / row.sum()) for row in shares)
    tables = {
        name: dict(zip(benchmark.OUTCOMES, map(int, row), strict=True))
        for name, row in zip(benchmark.TABLES, counts, strict=True)
    }
    won = {"captured": 1000, "evader_hit_obstacle": 100, "evader_out_of_range": 100}
    return tables | {"P_stage1 v still": {"captured": 1900}, "P_scratch v E_curriculum": won}


@pytest.mark.parametrize("number", [3, 11])
def test_posterior_is_about_the_settings_that_decide_the_outcomes(benchmark, number):
    random = np.random.default_rng(number)
    settings = [benchmark.draw_settings(random) for _ in range(60)]
    rows = [{"outcomes": outcomes_at(benchmark, one, random)} for one in settings]
    x = np.array([benchmark.features(one) for one in settings])
    y = np.array([benchmark.summary_of_draw(row) for row in rows])
    emulator = benchmark.Emulator.fit(x[1:], y[1:])
    assert benchmark.explained(y[1:], emulator) > 0.8
    prior = [benchmark.draw_settings(random) for _ in range(20_000)]
    prior_x = np.array([benchmark.features(one) for one in prior])
    values = np.array([astuple(one) for one in prior], float)
    accepted = values[benchmark.nearest(emulator.simulate(prior_x, random), y[0])]
    dt, discs, radius = accepted[:, :3].T
    low, high = np.quantile(dt, [0.05, 0.95])
    assert low < settings[0].dt < high < 2 * low
    assert abs(discs.mean() - settings[0].discs) < 0.7
    assert radius.std() > 0.8 * values[:, 2].std(), "which decides nothing"


def test_draws_are_done_by_their_numbers(benchmark, tmp_path, monkeypatch):
    """A second call does those that are missing."""
    called = []

    def run_draw(number, folder):
        called.append(number)
        return {"draw": number}

    monkeypatch.setattr(benchmark, "run_draw", run_draw)
    file = tmp_path / "draws.json"
    benchmark.draw(file, benchmark.numbers_of("4"))
    benchmark.draw(file, benchmark.numbers_of("2-5"))
    assert called == [4, 2, 3, 5]
    assert [row["draw"] for row in benchmark.read_rows(file)] == [2, 3, 4, 5]


def test_discs_keep_apart(benchmark):
    random = np.random.default_rng(0)
    for _ in range(20):
        settings = benchmark.draw_settings(random)
        discs = benchmark.place_discs(settings, random)
        assert len(discs) == settings.discs
        for number, disc in enumerate(discs):
            gaps = [math.hypot(disc.x - other.x, disc.y - other.y) for other in discs[:number]]
            assert all(gap >= 2 * settings.radius + 1 for gap in gaps)
            assert min(disc.x, disc.y, 10 - disc.x, 10 - disc.y) >= settings.radius + 1
