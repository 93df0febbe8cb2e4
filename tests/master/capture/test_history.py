"""What nodes read between two of their samples."""

from __future__ import annotations

import numpy as np
import pytest

from master.capture.history import KEPT, SampleHistory

ONE = np.ones(1, np.bool_)
STEP_S = 0.0025


def put(history: SampleHistory, first: int, last: int) -> None:
    """Samples of one node at 400 Hz, each of which reads its own number."""
    numbers = np.arange(first, last, dtype=np.float64)
    times_s = (STEP_S * numbers).tolist()
    history.put([0] * len(numbers), times_s, np.repeat(numbers[:, None], 13, axis=1))


def test_a_burst_that_overwrites_the_last_sample_before_the_instant_leaves_what_is_kept_in_use() -> None:
    history = SampleHistory(1, ONE, ONE)
    put(history, 0, 4)
    assert history.at(2.5 * STEP_S, [STEP_S]).values[0, 0] == pytest.approx(2.5)
    newest = KEPT + 20
    put(history, 4, newest + 1)
    lost = history.at((newest - KEPT - 0.5) * STEP_S, [STEP_S])
    assert not lost.known[0], "all that are kept are after the instant"
    found = history.at((newest - KEPT + 3.25) * STEP_S, [STEP_S])
    assert found.known[0]
    assert not found.held[0]
    assert found.values[0, 0] == pytest.approx(newest - KEPT + 3.25)
