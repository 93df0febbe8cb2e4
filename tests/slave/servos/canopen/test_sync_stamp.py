"""How wrong a SYNC's stamp may be: late SYNCs, slow hand-overs, and a host that is punctual again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from common.config.load import load_config
from common.skeleton import load_skeleton
from deploy.examples.profiles import NURSING, example
from slave.config import SlaveConfig
from slave.servos.canopen.config import CanopenConfig
from slave.servos.canopen.servos import CanopenServos
from slave.servos.canopen.sync_stamp import SyncStamps

PERIOD_NS, USUAL_NS = 20_000_000, 300_000


def punctual(stamps: SyncStamps, begin: int, end: int) -> None:
    for k in range(begin, end):
        stamps.sent(k * PERIOD_NS, k * PERIOD_NS)


def test_a_punctual_sync_is_wrong_by_what_is_usual() -> None:
    stamps = SyncStamps(PERIOD_NS, USUAL_NS)
    assert stamps.error_ns == USUAL_NS
    punctual(stamps, 0, 10)
    assert stamps.error_ns == USUAL_NS


@pytest.mark.parametrize("off_ns", [-2_000_000, 1_000_000])
def test_one_that_is_off_its_grid_adds_that_once(off_ns: int) -> None:
    stamps = SyncStamps(PERIOD_NS, USUAL_NS)
    punctual(stamps, 0, 10)
    stamps.sent(10 * PERIOD_NS + off_ns, 10 * PERIOD_NS + off_ns)
    assert stamps.error_ns == USUAL_NS + abs(off_ns)
    punctual(stamps, 11, 12)
    assert USUAL_NS < stamps.error_ns <= USUAL_NS + 0.021 * abs(off_ns)


def test_a_slow_hand_over_adds_the_time_it_took() -> None:
    stamps = SyncStamps(PERIOD_NS, USUAL_NS)
    punctual(stamps, 0, 10)
    stamps.sent(10 * PERIOD_NS, 10 * PERIOD_NS + 700_000)
    assert stamps.error_ns == USUAL_NS + 700_000


def test_a_sync_left_out_does_not_shift_the_grid() -> None:
    stamps = SyncStamps(PERIOD_NS, USUAL_NS)
    punctual(stamps, 0, 10)
    punctual(stamps, 13, 15)
    assert stamps.error_ns == USUAL_NS


def test_a_grid_that_has_moved_for_good_is_followed() -> None:
    stamps = SyncStamps(PERIOD_NS, USUAL_NS)
    punctual(stamps, 0, 10)
    for k in range(10, 310):
        stamps.sent(k * PERIOD_NS + 5_000_000, k * PERIOD_NS + 5_000_000)
    assert stamps.error_ns < USUAL_NS + 20_000


def test_the_file_says_what_is_usual(tmp_path: Path) -> None:
    text = example("slave", NURSING).read_text("utf-8")
    file = tmp_path / "slave.toml"
    file.write_text(text + "\n[servos.canopen]\nsample_error_ms = 1.5\n", "utf-8")
    config = load_config(file, SlaveConfig, ['servos.backend="canopen"'])
    assert config.servos.section(CanopenConfig).sample_error_ms == 1.5


def test_the_adapter_tells_how_long_handing_over_took() -> None:
    now_ns = 10**9

    class Slow(CanopenServos):
        def _send(self, outgoing: tuple[str, int, bytes | None]) -> None:
            nonlocal now_ns
            now_ns += 200_000

    servos = Slow(CanopenConfig(sample_error_ms=0.0), load_skeleton("nursing"), clock=lambda: now_ns)
    for _ in range(2):
        servos.write(np.zeros(25))
        now_ns += PERIOD_NS
    # the reading of the first SYNC, ended by the second: one SYNC on each of two buses
    assert servos.read().stamp_error_ns == 400_000
