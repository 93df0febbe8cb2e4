"""Sessions with planted errors: whatever is written is as right as it says it is; two of each kind.

All 200 sessions (some ten minutes): `python -m tests.master.calibrate.planted 0 200`.
"""

from collections import Counter

import pytest

from tests.master.calibrate.planted import KINDS, count


@pytest.mark.long
def test_nine_tenths_of_what_is_written_lie_within_the_stated_95_percent() -> None:
    found = count(range(2 * len(KINDS)))
    total: Counter[str] = sum(found.values(), Counter())
    assert total["covered"] >= 0.9 * total["written"], found
    assert found["sound"]["written"] >= 13
    assert found["two nodes exchanged"]["written"] == 0
    assert found["sides exchanged"]["written"] == 0
    assert all(counts["refused"] for kind, counts in found.items() if kind != "gyro axes exchanged")
