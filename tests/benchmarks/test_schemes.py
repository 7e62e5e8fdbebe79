"""The study of schemes: which trainings it does, and what its table says of them."""


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


def test_summary_predicts_the_next_training_and_pairs_seeds(benchmark):
    """Of 20, 30, 40 and 50 % the next is within 35 +- 3.18 x sqrt(5 / 4) x 12.9, and a scheme that loses 8 to 12
    points more from each seed loses 10 +- 3.18 x 1.63 / 2 more.
    """
    lost = {"latest": (0.2, 0.3, 0.4, 0.5), "uniform": (0.28, 0.4, 0.5, 0.62)}
    lost |= {name: (0.5,) * 4 for name in benchmark.SCHEMES if name not in lost}
    rows = [row(name, seed, share) for name, shares in lost.items() for seed, share in enumerate(shares)]
    lines = benchmark.summary(rows)
    assert lines[0] == "| `latest` |" + " 35 [0, 81] | +0 [+0, +0] |" * 4
    assert "| +10 [+7, +13] |" in lines[1]


def test_figure_is_drawn(benchmark, tmp_path):
    rows = [row(name, seed, lost) for name in benchmark.SCHEMES for seed, lost in ((0, 0.4), (1, 0.6))]
    benchmark.draw(rows, tmp_path / "schemes.png")
    assert (tmp_path / "schemes.png").stat().st_size > 10_000
