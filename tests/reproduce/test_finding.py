"""What the sections of a report are made of."""

from apollonius.reproduce.finding import outcome_table


def test_outcomes_over_seeds_have_an_interval_and_the_papers_counts_none():
    """Student's t with two degrees of freedom: 4.303 x 10 / sqrt(3) points."""
    ours = {"captured": [0.1, 0.2, 0.3], "both_failed": [0.0, 0.0, 0.0]}
    table = outcome_table([("here", ours), ("paper", {"captured": [0.124]}), ("one seed", {"both_failed": [0.5]})])
    assert table.splitlines()[2:] == [
        "| captured | 20.0 ± 24.8% | 12.4% | - |",
        "| both failed | 0.0 ± 0.0% | - | 50.0% |",
    ]
