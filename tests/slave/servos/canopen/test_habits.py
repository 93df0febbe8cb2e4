"""Habits of real drives that the standards permit, and what another master may have stored in one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from common.clock import NS_PER_MS
from common.skeleton import load_skeleton
from deploy.sim.drives.faults import DriveFault
from deploy.sim.drives.makers import Maker, epos, fixed
from deploy.sim.drives.traits import Traits
from slave.servos.canopen.cia402 import Power
from slave.servos.canopen.config import CanopenConfig
from tests.slave.servos.canopen.conftest import Wired
from tests.slave.servos.canopen.test_makers import JOINT, one

NURSING = load_skeleton("nursing")


def like(maker: Maker, change: Callable[[Traits], Traits]) -> Maker:
    return lambda node_id: change(maker(node_id))


def come_up(wired: Wired, seconds: float = 4.0) -> None:
    wired.start()
    wired.until(lambda: wired.drives.running, seconds)
    wired.run(1.0)
    assert wired.drives.running
    assert dict(wired.drives.faults) == {}


def refused(wired: Wired, seconds: float) -> str:
    wired.start()
    wired.until(lambda: wired.drives.failed, seconds)
    return wired.drives.not_running[JOINT]


def booting_twice(after_ms: int = 60, dead_ms: int = 500) -> Maker:
    dead_ns, again_ns = dead_ms * NS_PER_MS, after_ms * NS_PER_MS
    return like(epos, lambda t: replace(t, boots_after_ns=dead_ns, boots_again_after_ns=again_ns))


@pytest.mark.parametrize("after_ms", [1, 20, 60, 150, 400, 900])
def test_a_drive_that_reports_its_start_twice_is_taken_once_the_file_says_so(after_ms: int) -> None:
    """While it is configured, while it is checked, while it is enabled."""
    come_up(one(booting_twice(after_ms), boots_twice=True))


@pytest.mark.parametrize("after_ms", [1, 60])
def test_the_file_must_say_so(after_ms: int) -> None:
    assert "by its manual: then set boots_twice = true" in refused(one(booting_twice(after_ms)), 3.0)


def test_a_drive_that_restarts_while_it_runs_is_stopped_however_it_boots() -> None:
    wired = one(booting_twice(), boots_twice=True)
    come_up(wired)
    wired.happen(JOINT, DriveFault.RESTART)
    wired.run(0.1)
    assert wired.drives.failed
    assert "restarted" in wired.drives.not_running[JOINT]


def test_two_drives_of_one_id_are_found_all_the_same_where_drives_boot_twice() -> None:
    wired = one(booting_twice(dead_ms=0), boots_twice=True)
    wired.happen(JOINT, DriveFault.DOUBLE_ID)
    assert "two drives have its id" in refused(wired, 4.0)


@pytest.mark.parametrize(
    "maker",
    [like(epos, lambda t: replace(t, presets={**t.presets, (0x1400, 5): 5})), fixed],
    ids=["mapped anew", "as it is"],
)
def test_a_time_out_of_the_targets_that_is_shorter_than_a_sync_period_is_switched_off(maker: Maker) -> None:
    come_up(one(maker, holds_itself=True))


def test_a_drive_that_missed_its_targets_and_stopped_is_not_sent_on() -> None:
    """Told "enable" with the next SYNC it would go on, having braked, and do so again and again."""
    wired = one(epos)
    come_up(wired)
    drive = wired.peer.drives[wired.index(JOINT)]
    drive._timers.ms[0x1400] = 5
    wired.run(0.1)
    assert "has stopped by itself; it missed its PDO" in wired.drives.faults[JOINT]
    assert drive.state is not Power.ENABLED


def test_a_drive_that_waits_for_counted_syncs_is_told_that_there_are_none() -> None:
    with_counter = like(
        epos, lambda t: replace(t, lacks=t.lacks - {0x1019}, presets={**t.presets, (0x1019, 0): 10})
    )
    come_up(one(with_counter))


@pytest.mark.parametrize("bits", [1 << 8, 1 << 14, 1 << 15, 1 << 15 | 1 << 14 | 1 << 8])
def test_bits_of_the_makers_own_mean_nothing(bits: int) -> None:
    wired = one(like(epos, lambda t: replace(t, always_set=bits)))
    come_up(wired)
    assert wired.peer.drives[wired.index(JOINT)].state is Power.ENABLED


def test_a_drive_that_knows_shorter_periods_only_is_refused_with_what_to_do() -> None:
    short = like(epos, lambda t: replace(t, longest_period_ms=10))
    words = refused(one(short), 2.0)
    assert "does not take a SYNC period of 20 ms (object 60C2:1: value too high)" in words
    assert "set sync_hz in [servos.canopen]" in words
    drives = CanopenConfig().drives_of(NURSING)
    drives[JOINT] = drives[JOINT].model_copy(update={"encoder": None})
    wired = Wired(CanopenConfig(drives=drives, sync_hz=100))
    wired.peer.build(JOINT, short)
    come_up(wired)


def test_answers_that_come_after_the_request_was_repeated_confuse_nothing() -> None:
    """Such a drive answers both requests, the second one while the next transfer is under way."""
    slow = like(epos, lambda t: replace(t, answers_after_ns=350 * NS_PER_MS))
    come_up(one(slow), 60.0)
