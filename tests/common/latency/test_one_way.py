"""One way and round trip, from stamps of two clocks that differ by a day."""

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from common.clock import NS_PER_MS, NS_PER_S
from common.clock_sync import Offset
from common.latency.one_way import master_offset, one_way_ns, round_trip_ns
from common.wire.messages import CommandEcho, RobotState

TRANSITS = st.integers(0, NS_PER_S)
MASTER_AHEAD_NS = 86_400 * NS_PER_S
NONE = np.zeros(0)
STATE = RobotState("r", 1, 1, 1, "hold", "", "", NONE.astype(bool), NONE, NONE, None, 0, -1)


@given(there=TRANSITS, on_slave=TRANSITS, back=TRANSITS)
def test_the_ways_there_and_back_add_up_to_the_round_trip(there: int, on_slave: int, back: int) -> None:
    put_ns = 5 * NS_PER_MS
    received_ns = put_ns + there - MASTER_AHEAD_NS
    sent_ns = received_ns + on_slave
    arrived_ns = sent_ns + back + MASTER_AHEAD_NS
    offset = Offset(MASTER_AHEAD_NS, NS_PER_MS, trusted=True)
    echo = CommandEcho(1, put_ns, received_ns, received_ns, 0)
    state = replace(STATE, sent_ns=sent_ns, echo=echo)
    assert one_way_ns(put_ns, received_ns, offset) == there
    assert one_way_ns(sent_ns, arrived_ns, offset.reversed()) == back
    assert round_trip_ns(state, echo, arrived_ns) == there + back


def test_without_a_trusted_offset_there_is_no_one_way_time() -> None:
    assert one_way_ns(1, 2, Offset(0, 0, trusted=False)) is None


def test_a_negative_bound_on_the_wire_means_no_trust() -> None:
    known = replace(STATE, master_offset_ns=7, offset_bound_ns=3)
    assert master_offset(known) == Offset(7, 3, trusted=True)
    unknown = master_offset(replace(STATE, master_offset_ns=7, offset_bound_ns=-1))
    assert (unknown.offset_ns, unknown.trusted) == (7, False)
