"""`tandem calibrate live` and `record` at a real bus, with the simulated suit as another process."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from deploy.examples.profiles import EXAMPLES
from deploy.harness.endpoints import local_endpoints
from master.calibrate.recording import load_recordings

pytestmark = [pytest.mark.live, pytest.mark.usefixtures("default_signals")]

WORN = ("left_thigh", "left_shank")
"""Of the legs' seven nodes these two answer; the others are silent, and not waited for."""
SUIT = """
profile = "lower_limb"
motion = "tray"
grade = "raw"
tray = {{ attitudes = 1, still_s = 0.5, tumble_s = 60.0 }}

[[buses]]
name = "suit"
interface = "udp_multicast"
channel = "239.74.163.2"
options = {{ port = {port}, hop_limit = 0 }}

[nodes]
left_thigh = {{ id = 38, bus = "suit" }}
left_shank = {{ id = 39, bus = "suit" }}
"""
TANDEM = (sys.executable, "-m", "deploy")


@pytest.fixture
def port(default_signals: None, tmp_path: Path) -> Iterator[int]:
    """The CAN port on which a suit answers."""
    port = local_endpoints("tcp", tmp_path).can_port
    file = tmp_path / "suit.toml"
    file.write_text(SUIT.format(port=port), "utf-8")
    suit = subprocess.Popen([*TANDEM, "suit", str(file)], stderr=subprocess.PIPE)
    try:
        yield port
        suit.send_signal(signal.SIGTERM)
        suit.communicate(timeout=10.0)
    finally:
        suit.kill()
        suit.communicate()


def tandem(port: int, command: str, *options: str) -> list[str]:
    master = str(EXAMPLES / "lower_limb" / "master.toml")
    settings = [f"capture.buses.0.options.port={port}", "capture.rate_hz=50"]
    settings += [f"estimation.{s}_cutoff_hz=0.0" for s in ("accelerometer", "gyroscope", "magnetometer")]
    sets = [word for setting in settings for word in ("--set", setting)]
    return [*TANDEM, "calibrate", command, master, *options, *sets]


def test_the_magnetometers_are_calibrated_from_the_bus(port: int, tmp_path: Path) -> None:
    out = tmp_path / "calibration"
    report = tmp_path / "report.json"
    options = ["--out", str(out), "--what", "mag", "--tumble-s", "2", "--coverage", "0.6"]
    options += ["--report", str(report)]
    ran = subprocess.run(tandem(port, "live", *options), capture_output=True, text=True, timeout=100.0)
    assert ran.returncode == 0, ran.stderr
    assert "1/1 Turn about freely" in ran.stderr
    assert {path.stem for path in out.glob("*.toml")} == set(WORN)
    assert {path.name for path in out.glob("*.png")} == {f"{name}_mag.png" for name in WORN}
    figures = json.loads(report.read_text("utf-8"))
    for name in WORN:
        magnetometer = figures["mag"]["nodes"][name]["magnetometer"]
        assert magnetometer["hold_out"] < 0.2 * magnetometer["residual_before"]
    assert set(load_recordings(out / "tray.mcap")) == set(WORN)


def test_what_was_recorded_stays_when_a_person_stops_early(port: int, tmp_path: Path) -> None:
    out = tmp_path / "calibration"
    live = subprocess.Popen(tandem(port, "live", "--out", str(out)), stderr=subprocess.PIPE, text=True)
    try:
        assert live.stderr is not None
        said = [next(live.stderr)]
        while "1/5" not in said[-1]:
            said.append(next(live.stderr))
        time.sleep(1.0)
        live.send_signal(signal.SIGINT)
        rest = live.communicate(timeout=20.0)[1]
    finally:
        live.kill()
        live.communicate()
    assert live.returncode == 1
    assert "stopped before the end; recorded so far:" in rest
    assert "Traceback" not in rest
    assert load_recordings(out / "tray.mcap")["left_shank"].duration_s > 0.5


def test_record_takes_as_long_as_told_and_never_writes_over(port: int, tmp_path: Path) -> None:
    out = tmp_path / "session.mcap"
    command = tandem(port, "record", "--out", str(out), "--seconds", "1.5")
    ran = subprocess.run(command, capture_output=True, text=True, timeout=60.0)
    assert ran.returncode == 0, ran.stderr
    assert "2 of 7 nodes answer; silent: pelvis" in ran.stderr
    nodes = load_recordings(out)
    assert set(nodes) == set(WORN)
    assert nodes["left_thigh"].duration_s == pytest.approx(1.5, rel=0.2)
    content = out.read_bytes()
    again = subprocess.run(command, capture_output=True, text=True, timeout=60.0)
    assert again.returncode == 1
    assert "is there already" in again.stderr
    assert out.read_bytes() == content


def test_a_suit_that_is_off_is_said(tmp_path: Path) -> None:
    nobody = local_endpoints("tcp", tmp_path).can_port
    command = tandem(nobody, "record", "--out", str(tmp_path / "a.mcap"), "--seconds", "0.5")
    ran = subprocess.run(command, capture_output=True, text=True, timeout=60.0)
    assert ran.returncode == 1
    assert "no node answered" in ran.stderr
