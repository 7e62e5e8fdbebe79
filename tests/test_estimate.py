"""The estimate of a long work: one over all its pieces, and none where nothing is known."""

import pytest

from apollonius.estimate import Estimate


class Clock:
    """A time that passes when it is told to."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


def go(estimate, clock, seconds, shares):
    """Report so many shares, each after so many seconds."""
    left = []
    for share in shares:
        clock.now += seconds
        estimate.report(share, 1)
        left.append(estimate.left)
    return left


def test_nothing_is_said_before_anything_is_known(clock):
    estimate = Estimate(clock)
    assert (estimate.what, estimate.share, estimate.left) == (None, None, None)
    estimate.begin("playing")
    clock.now += 20
    assert (estimate.what, estimate.share, estimate.left) == ("playing", None, None)
    assert go(estimate, clock, 0.5, [0.01, 0.02, 0.03]) == [None, None, None]


def test_compiling_does_not_count_as_speed(clock):
    """Half a minute before the first report, then one per cent a second: 97 s are left, not 32 minutes."""
    estimate = Estimate(clock)
    estimate.begin("playing")
    clock.now += 30
    assert go(estimate, clock, 1, [0.0, 0.01, 0.02, 0.03])[-1] == pytest.approx(97)
    assert estimate.share == pytest.approx(0.03)


def test_one_long_pause_does_not_count_as_speed_either(clock):
    estimate = Estimate(clock)
    estimate.begin("training")
    go(estimate, clock, 1, [n / 100 for n in range(11)])
    clock.now += 40
    assert go(estimate, clock, 0, [0.11])[-1] == pytest.approx(89, rel=0.1)


def test_it_is_one_estimate_over_all_pieces(clock):
    """Pieces of 100, 200 and 20 units at one unit a second, each after 10 s of compiling: from the first second on the
    time left is that of all three, and it never jumps.
    """
    estimate = Estimate(clock)
    estimate.plan({"stage 1": 100.0, "stage 2": 200.0, "judging": 20.0})
    end, seen = clock.now + 10 + 100 + 10 + 200 + 10 + 20, []
    for what, amount in (("stage 1", 100), ("stage 2", 200), ("judging", 20)):
        estimate.begin(what)
        for _ in range(10):
            seen.append((end - clock.now, estimate.left))
            clock.now += 1
        for done in range(amount + 1):
            estimate.report(done, amount)
            seen.append((end - clock.now, estimate.left))
            clock.now += done < amount
    known = [(true, said) for true, said in seen if said is not None]
    assert len(known) > len(seen) - 15
    assert max(abs(true - said) for true, said in known) < 1e-6
    assert estimate.share == 1


def test_time_goes_on_between_reports_but_never_to_nothing(clock):
    estimate = Estimate(clock)
    estimate.begin("sweeping")
    go(estimate, clock, 10, [0.1, 0.2, 0.3])
    clock.now += 20
    assert estimate.left == pytest.approx(50)
    clock.now += 1000
    assert estimate.left == pytest.approx(35)


def test_a_resumed_work_begins_where_it_stands(clock):
    estimate = Estimate(clock)
    estimate.plan({"stage 1": 100.0, "stage 2": 100.0})
    estimate.begin("stage 2")
    assert go(estimate, clock, 1, [0.5, 0.51, 0.52, 0.53])[-1] == pytest.approx(47)
    assert estimate.share == pytest.approx(0.765)
