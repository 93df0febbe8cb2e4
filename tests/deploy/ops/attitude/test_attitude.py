"""`tandem attitude`: simulated, sent over a pseudo-terminal and read there, and a person's mistakes."""

from __future__ import annotations

import asyncio
import io
import json
import math
import os
import pty
import shlex
import sys
import tty
from collections.abc import Iterator

import pytest
from rich.console import Console

from common.errors import TandemError
from deploy import cli
from deploy.ops.attitude.reading import AngleRange, AttitudeLog, Reading
from deploy.ops.attitude.run import AttitudeOptions, show_attitude
from deploy.ops.attitude.view import screen

PAPER = bytes.fromhex("FF 01 00 23 44 05 61")


@pytest.fixture
def line() -> Iterator[tuple[int, str]]:
    """Our end, and the name of the other."""
    end, held = pty.openpty()
    tty.setraw(end)
    tty.setraw(held)
    yield end, os.ttyname(held)
    os.close(end)
    os.close(held)


def shown(options: AttitudeOptions) -> tuple[AttitudeLog, str]:
    out = io.StringIO()
    console = Console(file=out, width=80)

    async def show() -> AttitudeLog:
        return await show_attitude(options, asyncio.Event(), console)

    return asyncio.run(show()), out.getvalue()


def test_simulated_json_is_one_object_a_reading_near_where_it_stands() -> None:
    session, out = shown(AttitudeOptions(seconds=0.5, as_json=True, declination_deg=2.0))
    rows = [json.loads(row) for row in out.splitlines()]
    assert len(rows) == session.readings > 0
    last = rows[-1]
    assert last["inclination_deg"] == pytest.approx(10.0, abs=0.5)
    assert last["magnetic_azimuth_deg"] == pytest.approx(235.0, abs=3.0)
    assert last["azimuth_deg"] == pytest.approx(last["magnetic_azimuth_deg"] + 2.0, abs=0.002)
    assert last["tool_face_deg"] == last["gravity_tool_face_deg"] == pytest.approx(56.0, abs=3.0)


def test_a_vertical_one_has_no_azimuth() -> None:
    session, out = shown(AttitudeOptions(seconds=0.1, as_json=True, inclination_deg=0.0))
    assert json.loads(out.splitlines()[-1])["azimuth_deg"] is None
    assert session.newest is not None
    assert "–" in rendered(session)


def test_what_is_simulated_is_sent_as_frames(line: tuple[int, str]) -> None:
    end, port = line
    shown(AttitudeOptions(seconds=0.3, as_json=True, to=port))
    frames = os.read(end, 1000)
    assert len(frames) % 7 == 0
    assert frames[0] == 0xFF
    assert int(frames[1:3].hex()) == pytest.approx(100, abs=5)


def test_frames_are_shown_with_the_true_azimuth(line: tuple[int, str]) -> None:
    end, port = line

    async def show() -> AttitudeLog:
        stop, out = asyncio.Event(), io.StringIO()
        options = AttitudeOptions(port=port, declination_deg=-2.5, as_json=True)
        showing = asyncio.create_task(show_attitude(options, stop, Console(file=out, width=80)))
        # what comes before the port is open is dropped: send until one is through
        for _ in range(2000):
            if out.getvalue():
                break
            os.write(end, b"\x00" + PAPER)
            await asyncio.sleep(0.01)
        stop.set()
        return await showing

    session = asyncio.run(show())
    assert session.newest is not None
    row = session.newest.as_json()
    assert (row["inclination_deg"], row["magnetic_azimuth_deg"], row["tool_face_deg"]) == (10.0, 234.4, 56.1)
    assert row["azimuth_deg"] == 231.9
    assert "gravity_tool_face_deg" not in row


def test_a_line_that_says_nothing_sensible_is_an_error_with_its_counts(line: tuple[int, str]) -> None:
    with pytest.raises(TandemError, match=r"frames 0.*--baud"):
        shown(AttitudeOptions(port=line[1], seconds=0.1))


def rendered(session: AttitudeLog) -> str:
    out = io.StringIO()
    Console(file=out, width=80).print(screen(session, 5.0, "here", {"refused": 3}))
    return out.getvalue()


def test_the_screen_says_what_is_silent_and_what_was_refused() -> None:
    assert "nothing yet" in rendered(AttitudeLog())
    session = AttitudeLog()
    session.add(Reading(1.0, {"inclination": math.radians(10.04), "azimuth": math.radians(359.0)}))
    session.add(Reading(2.0, {"inclination": math.radians(9.86), "azimuth": math.radians(1.0)}))
    text = rendered(session)
    for part in ("9.9", "10.0", "359.0", "361.0", "silent for 3 s", "refused 3"):
        assert part in text


def test_a_span_goes_over_the_end_of_a_turn() -> None:
    span = AngleRange()
    assert span.ends is None
    for degrees in (1.0, None, 359.0, 2.0):
        span.add(None if degrees is None else math.radians(degrees))
    assert span.ends is not None
    assert [math.degrees(end) for end in span.ends] == pytest.approx([-1.0, 2.0])


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("", "PORT"),
        ("/dev/x --simulate", "PORT"),
        ("/dev/x --to /dev/y", "--to"),
        ("/dev/no-such-port", "/dev/no-such-port does not open"),
        ("--simulate --to /dev/no-such-port", "/dev/no-such-port does not open"),
        ("--simulate --inclination 200", "180"),
    ],
)
def test_a_mistake_is_said(
    arguments: str, said: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["tandem", "attitude", *shlex.split(arguments)])
    with pytest.raises(SystemExit) as left:
        cli.main()
    assert left.value.code != 0
    assert said in capsys.readouterr().err
