"""The histogram gives what HdrHistogram gives, where that package is installed; three digits everywhere."""

from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.latency.histogram import Histogram

HIGHEST = 60_000_000
VALUES = st.lists(st.integers(1, HIGHEST), min_size=1, max_size=200)


@given(VALUES, st.floats(0.5, 100.0))
def test_percentiles_are_those_of_hdrhistogram(values: Sequence[int], percentile: float) -> None:
    theirs = pytest.importorskip("hdrh.histogram").HdrHistogram(1, HIGHEST, 3)
    ours = Histogram(HIGHEST)
    for k, value in enumerate(values):
        theirs.record_value(value, 1 + k % 3)
        ours.record(value, 1 + k % 3)
    assert ours.count == theirs.get_total_count()
    assert ours.at_percentile(percentile) == theirs.get_value_at_percentile(percentile)


@given(VALUES)
def test_three_digits(values: Sequence[int]) -> None:
    ours = Histogram(HIGHEST)
    for value in values:
        ours.record(value)
    for k, value in enumerate(sorted(values)):
        found = ours.at_percentile(100.0 * (k + 1) / len(values))
        assert value <= found <= value * 1.001 + 1


def test_the_ends() -> None:
    ours = Histogram(HIGHEST)
    assert ours.at_percentile(50) == 0
    ours.record(0)
    assert ours.at_percentile(99) == 0
    ours.record(HIGHEST, 10)
    assert ours.at_percentile(99) == pytest.approx(HIGHEST, rel=1e-3)
    for wrong in (-1, HIGHEST + 1):
        with pytest.raises(ValueError, match="expected 0 to 60000000"):
            ours.record(wrong)
