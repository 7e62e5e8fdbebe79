"""The study of schemes: which trainings it does, and what its table says of them."""

import importlib.util
from pathlib import Path

import pytest

FILE = Path(__file__).parents[2] / "benchmarks" / "schemes.py"


@pytest.fixture(scope="module")
def benchmark():
    spec = importlib.util.spec_from_file_location(FILE.stem, FILE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def row(scheme, seed, lost=0.5):
    judges = {judge: {"loses": lost} for judge in ("response", "planner", "table")}
    return {"scheme": scheme, "seed": seed, "pursuer": judges, "evader": judges}


def test_schemes_differ_in_nothing_but_whom_they_meet_and_the_magnet(benchmark):
    others = {scheme.opponents for scheme in benchmark.SCHEMES.values() if not scheme.algorithm.magnet}
    assert others == {"latest", "uniform", "prioritised-hard"}
    pulled = [scheme for scheme in benchmark.SCHEMES.values() if scheme.algorithm.magnet]
    assert [scheme.opponents for scheme in pulled] == ["latest"]
    assert len({scheme.algorithm for scheme in benchmark.SCHEMES.values()}) == 2


def test_only_trainings_that_the_file_lacks_are_done_seed_by_seed(benchmark, tmp_path, monkeypatch):
    done = list[tuple[str, int]]()

    def run(name, seed, folder):
        done.append((name, seed))
        return row(name, seed)

    monkeypatch.setattr(benchmark, "run_training", run)
    file = tmp_path / "schemes.json"
    benchmark.write_rows(file, [row("uniform", 1)])
    benchmark.train_all(file, range(1, 3), ["latest", "uniform"], tmp_path)
    assert done == [("latest", 1), ("latest", 2), ("uniform", 2)]
    kept = [(each["scheme"], each["seed"]) for each in benchmark.read_rows(file)]
    assert kept == [("uniform", 1), *done]


def test_table_states_the_mean_and_the_interval_of_the_next_training(benchmark, tmp_path, capsys):
    """Of two trainings of 40 and 60 % the next is within 50 +- 12.7 x sqrt(2) x sqrt(3 / 2) x 10."""
    rows = [row(name, seed, lost) for name in benchmark.SCHEMES for seed, lost in ((0, 0.4), (1, 0.6))]
    rows += [row("latest", 2, 0.5), row("latest", 3, 0.5)]
    benchmark.draw(rows, tmp_path / "schemes.png")
    lines = capsys.readouterr().out.splitlines()
    assert lines[1] == "| `uniform` |" + " 50 % [0, 100] |" * 6
    assert lines[0] == "| `latest` |" + " 50 % [21, 79] |" * 6
    assert (tmp_path / "schemes.png").stat().st_size > 10_000
