"""What chronyd and ptp4l state: their answers read, and real daemons asked where there are any."""

from __future__ import annotations

import asyncio
import logging
import socket
import struct
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.clock import monotonic_ns, wall_ns
from common.clock_sync.chrony import ANSWER_BYTES, read_tracking, tracking_request
from common.clock_sync.config import ClockConfig
from common.clock_sync.ptp import PtpState, read_state
from common.clock_sync.services import TimeServices, keep_reference, read_beside

PMC = """sending: GET TIME_STATUS_NP
	0a56c0.fffe.d7f247-0 seq 0 RESPONSE MANAGEMENT TIME_STATUS_NP
		master_offset              -244
		gmPresent                  true
		gmIdentity                 6abae6.fffe.f25022
	0a56c0.fffe.d7f247-0 seq 1 RESPONSE MANAGEMENT CURRENT_DATA_SET
		stepsRemoved     1
		meanPathDelay    1806.0
	0a56c0.fffe.d7f247-0 seq 2 RESPONSE MANAGEMENT PARENT_DATA_SET
		gm.ClockAccuracy                      0x21
	0a56c0.fffe.d7f247-0 seq 3 RESPONSE MANAGEMENT TIME_PROPERTIES_DATA_SET
		currentUtcOffset      37
		leap61                0
		leap59                0
		currentUtcOffsetValid 1
		ptpTimescale          1
		timeTraceable         1
	0a56c0.fffe.d7f247-1 seq 4 RESPONSE MANAGEMENT PORT_DATA_SET
		portState               SLAVE
	0a56c0.fffe.d7f247-1 seq 5 RESPONSE MANAGEMENT PORT_PROPERTIES_NP
		timestamping            HARDWARE
"""


def coded(seconds: float) -> int:
    """chrony's float: exponent and coefficient."""
    exponent = 0
    while abs(seconds) >= 0.5:
        seconds, exponent = seconds / 2, exponent + 1
    while seconds and abs(seconds) < 0.25 and exponent > -60:
        seconds, exponent = seconds * 2, exponent - 1
    return (exponent & 0x7F) << 25 | round(seconds * 2**25) & 0x1FFFFFF


def answer(
    number: int, correction_s: float = 0.0, delay_s: float = 0.002, reference: int = 0x0A630101, leap: int = 0
) -> bytes:
    floats = [correction_s, 1e-6, 1e-6, 0.1, 0.0, 0.05, delay_s, 0.0005, 1.0]
    head = struct.pack("!BBBBHHHHHHIII", 6, 2, 0, 0, 33, 5, 0, 0, 0, 0, number, 0, 0)
    body = struct.pack("!I16sHHHHIII9I", reference, b"", 1, 0, 2, leap, 0, 0, 0, *map(coded, floats))
    return head + body


@given(st.floats(-1000.0, 1000.0))
def test_chronys_own_floats_are_read(seconds: float) -> None:
    tracking = read_tracking(answer(7, seconds), 7)
    assert tracking is not None
    assert tracking.correction_s == pytest.approx(seconds, rel=1e-6, abs=1e-15)


def test_the_stated_error_is_dispersion_and_half_the_delay_and_the_newest_offset() -> None:
    tracking = read_tracking(answer(7), 7)
    assert tracking is not None
    assert tracking.error_ns == pytest.approx(500_000 + 1_000_000 + 1_000, rel=1e-5)
    assert tracking.nothing_stated == ""


@pytest.mark.parametrize(
    ("reference", "leap", "why"),
    [(0x7F7F0101, 0, "its own clock"), (0, 0, "not synchronised"), (0x0A630101, 3, "not synchronised")],
)
def test_a_daemon_that_follows_nobody_states_nothing(reference: int, leap: int, why: str) -> None:
    tracking = read_tracking(answer(1, reference=reference, leap=leap), 1)
    assert tracking is not None
    assert why in tracking.nothing_stated


@pytest.mark.parametrize(
    ("figure", "value", "why"),
    [
        ("correction_s", 17.0, "a correction of 17 s, expected -16 to 16"),
        ("last_offset_s", -17.0, "a newest offset of -17 s"),
        ("skew_ppm", -1.0, "a skew of -1 ppm"),
        ("root_delay_s", -0.002, "a root delay of -0.002 s, expected 0 to 16"),
        ("root_dispersion_s", -0.001, "a root dispersion of -0.001 s"),
        ("root_dispersion_s", 20.0, "a root dispersion of 20 s"),
    ],
)
def test_figures_that_no_clock_has_are_not_believed(figure: str, value: float, why: str) -> None:
    tracking = read_tracking(answer(1), 1)
    assert tracking is not None
    changed: dict[str, Any] = {figure: value}
    stated = replace(tracking, **changed).nothing_stated
    assert stated.startswith("chronyd states")
    assert why in stated
    perfect = replace(tracking, root_delay_s=0.0, root_dispersion_s=0.0, last_offset_s=0.0)
    assert "an error of nothing" in perfect.nothing_stated, "a bound of 0 would beat every true one"


@given(st.binary(max_size=200))
def test_what_is_no_answer_is_none(noise: bytes) -> None:
    assert read_tracking(noise, 7) is None


def test_an_answer_to_another_question_is_none() -> None:
    assert read_tracking(answer(7), 8) is None
    assert read_tracking(answer(7)[:-1], 7) is None
    assert len(tracking_request(7)) == ANSWER_BYTES == len(answer(7))  # shorter, it would not be answered


def test_a_traceable_hardware_clock_states_utc() -> None:
    assert read_state(PMC) == PtpState(-244, 244 + 1806 + 100, "utc", 37, leaps=False, hardware=True)


@pytest.mark.parametrize(
    ("old", "new", "scale", "utc_offset_s"),
    [
        ("timeTraceable         1", "timeTraceable 0", "ptp 6abae6.fffe.f25022", 37),
        ("ptpTimescale          1", "ptpTimescale 0", "ptp 6abae6.fffe.f25022", 0),
        ("0x21", "0xfe", "ptp 6abae6.fffe.f25022", 37),
    ],
)
def test_an_untraceable_grandmaster_is_a_scale_of_its_own(
    old: str, new: str, scale: str, utc_offset_s: int
) -> None:
    state = read_state(PMC.replace(old, new))
    assert isinstance(state, PtpState)
    assert (state.scale, state.utc_offset_s, state.error_ns) == (scale, utc_offset_s, 244 + 1806)


def test_a_port_that_is_not_steered_states_nothing() -> None:
    assert read_state(PMC.replace("SLAVE", "UNCALIBRATED")) == "ptp4l's port is UNCALIBRATED"
    assert read_state(PMC.replace("gmPresent                  true", "gmPresent false")) == (
        "ptp4l's port is SLAVE"
    )
    alone = read_state(
        PMC.replace("gmPresent                  true", "gmPresent false").replace("SLAVE", "MASTER")
    )
    assert isinstance(alone, PtpState)
    assert alone.offset_ns == 0
    assert read_state("") == "ptp4l does not tell portState"
    assert read_state(PMC.replace("1806.0", "x")).startswith("ptp4l tells what is no number")  # type: ignore[union-attr]


def test_clocks_are_read_beside_each_other_within_what_the_reading_took() -> None:
    times = iter([0, 30, 100, 110, 200, 230, 300, 330, 400, 430])
    at_ns, ahead_ns, half_ns = read_beside(lambda: 5_000, lambda: next(times))
    assert (at_ns, ahead_ns, half_ns) == (105, 4_895, 5)


def test_a_chronyd_is_asked_and_its_correction_is_applied() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as daemon:
        daemon.bind(("127.0.0.1", 0))

        def serve() -> None:
            question, who = daemon.recvfrom(1024)
            (number,) = struct.unpack_from("!I", question, 8)
            daemon.sendto(answer(number, correction_s=0.25), who)

        thread = threading.Thread(target=serve)
        thread.start()
        services = TimeServices(ClockConfig(source="chrony", chrony_port=daemon.getsockname()[1]))
        services.read()
        thread.join()
    reference = services.track.reference(monotonic_ns())
    assert reference is not None
    now_ahead_ns = wall_ns() - monotonic_ns()
    assert abs(reference.ahead_ns - 250_000_000 - now_ahead_ns) < 20_000_000
    assert services.words.startswith("chrony states ± 1.5")


def test_no_service_is_said_and_the_round_trip_remains(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as unused:
        unused.bind(("127.0.0.1", 0))
        port = unused.getsockname()[1]
    services = TimeServices(ClockConfig(chrony_port=port, ptp_socket=str(tmp_path / "none")))
    services.read()
    assert services.track.reference(monotonic_ns()) is None
    assert services.words == f"chronyd at UDP port {port}: Connection refused"


def test_a_path_delay_below_nothing_is_an_error_as_large_and_never_a_negative_one() -> None:
    state = read_state(PMC.replace("1806.0", "-5000.0"))
    assert isinstance(state, PtpState)
    assert state.error_ns == 244 + 5000 + 100


@pytest.mark.parametrize("delay", ["inf", "nan"])
def test_what_is_no_finite_number_states_nothing(delay: str) -> None:
    assert str(read_state(PMC.replace("1806.0", delay))).startswith("ptp4l tells what is no number")


def test_a_service_that_cannot_be_asked_ends_no_session(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Whatever goes wrong with it: robot and master do without."""
    caplog.set_level(logging.INFO)

    def fails(_: TimeServices) -> None:
        b"\xff".decode()

    monkeypatch.setattr(TimeServices, "read", fails)
    told: list[object] = []

    async def story() -> None:
        async with asyncio.timeout(5.0):
            keeping = asyncio.create_task(keep_reference(ClockConfig(), lambda one, _: told.append(one)))
            while not told and not keeping.done():  # noqa: ASYNC110  # asked in a thread
                await asyncio.sleep(0.01)
            assert not keeping.done()
            keeping.cancel()

    asyncio.run(story())
    assert told[0] is None
    assert "the time service cannot be asked" in caplog.text
