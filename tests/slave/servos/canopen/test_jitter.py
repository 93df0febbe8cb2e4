"""SYNC comes early and late on a busy host: as readings tell how wrong their stamps are, nothing stops."""

from __future__ import annotations

import numpy as np
import pytest

from common.clock import NS_PER_MS
from slave.contact.config import ContactConfig
from slave.contact.watch import ContactWatch
from slave.encoders.counts import Encoders
from slave.servos.canopen.wiring import Outgoing
from tests.slave.servos.canopen.conftest import STEP_NS, Wired

PERIODS = 150


def watched(*, locked: bool, allowed_for: bool) -> ContactWatch:
    """Both shoulders swing. SYNCs are up to 3 ms off; `locked` drives read angles as if they were not.

    Other drives read them as SYNC arrives, up to 0.3 ms from its stamp.
    """
    wired, random = Wired(), np.random.default_rng(5)
    wired.up()
    wired.setpoint = wired.read_rad().copy()
    wired.run(1.0)
    watch, encoders, start = (
        ContactWatch(wired.skeleton, ContactConfig()),
        Encoders(wired.skeleton),
        wired.now_ns,
    )
    rest = wired.setpoint.copy()
    for k in range(PERIODS):
        swing = 0.6 * (1.0 - np.cos(2.0 * np.pi * 0.7 * 0.02 * k))
        wired.setpoint = rest.copy()
        for side in ("left", "right"):
            wired.setpoint[wired.index(f"{side}_shoulder_pitch")] += swing
        due_ns = start + (k + 1) * wired.config.period_ns
        while wired.now_ns < due_ns:
            wired.now_ns += STEP_NS
            wired.peer.advance(wired.now_ns)
        off_ns = round(random.uniform(-1.0, 1.0) * (3.0 if locked else 0.3) * NS_PER_MS)
        for frame in wired.drives.cycle(due_ns, wired.setpoint):
            give(wired, frame, due_ns)
        for frame in wired.drives.sync(due_ns + off_ns if locked else due_ns):
            give(wired, frame, due_ns if locked else due_ns + off_ns)
        wired.drives.synced(due_ns + off_ns if locked else due_ns)
        reading = wired.drives.reading
        if not allowed_for:
            reading = type(reading)(
                reading.read_ns, reading.counts, reading.valid, reading.drive_rad, reading.effort_nm
            )
        watch.look(due_ns, reading, encoders.position_rad(reading.counts))
    assert watch.observer.ready
    return watch


def give(wired: Wired, frame: Outgoing, now_ns: int) -> None:
    bus, identifier, data = frame
    assert data is not None
    wired.peer.on_frame(bus, identifier, data, now_ns)


@pytest.mark.parametrize("locked", [True, False])
def test_a_host_that_is_late_makes_no_false_stop(locked: bool) -> None:
    assert watched(locked=locked, allowed_for=True).count == 0


def test_without_what_stamps_tell_it_would() -> None:
    assert watched(locked=True, allowed_for=False).count > 0
