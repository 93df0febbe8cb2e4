"""The units as systemd itself judges them, and what the rest of the project promises about them."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from common.process.notify import PINGS_A_PERIOD
from common.process.realtime import ProcessConfig
from common.process.runtime import SHUTDOWN_S
from deploy import cli

FOLDER = Path(cli.__file__).parent / "ops" / "systemd"
INSTANCES = {
    "tandem-slave@.service": "tandem-slave@robot.service",
    "tandem-master@.service": "tandem-master@operator.service",
    "tandem-can@.service": "tandem-can@can0.service",
    "tandem-router.service": "tandem-router.service",
    "tandem-record@.service": "tandem-record@operator.service",
    "tandem-console@.service": "tandem-console@operator.service",
}
SIDES = ("tandem-slave@.service", "tandem-master@.service", "tandem-router.service")
INSTALLED = "/opt/tandem/bin/tandem"
MOST_EXPOSED = 2.5
"""Of systemd's 0 (safe) to 10: what its own report calls OK ends there."""

needs_systemd = pytest.mark.skipif(
    shutil.which("systemd-analyze") is None, reason="no systemd-analyze: apt install systemd"
)


def settings(unit: str, section: str = "Service") -> dict[str, list[str]]:
    """Every setting of one section, in the order given; comments are left out."""
    found: dict[str, list[str]] = {}
    at = ""
    for line in (FOLDER / unit).read_text("utf-8").splitlines():
        if line.startswith("["):
            at = line.strip("[]")
        elif at == section and "=" in line and not line.startswith("#"):
            key, _, value = line.partition("=")
            found.setdefault(key, []).append(value)
    return found


@pytest.fixture
def instances(tmp_path: Path) -> list[Path]:
    """The units as they would be started, with a program that is there."""
    here = shutil.which("true") or sys.executable
    for unit, instance in INSTANCES.items():
        text = (FOLDER / unit).read_text("utf-8")
        for program in (f"{INSTALLED}-console", INSTALLED):
            text = text.replace(program, here)
        (tmp_path / instance).write_text(text.replace("/bin/ip ", f"{here} "), "utf-8")
    return [tmp_path / instance for instance in INSTANCES.values()]


def analyze(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["systemd-analyze", "--no-pager", *arguments], capture_output=True, text=True, check=False, timeout=60
    )


def test_every_unit_of_the_folder_is_tested() -> None:
    assert {path.name for path in FOLDER.glob("*.service")} == set(INSTANCES)


@needs_systemd
def test_systemd_finds_nothing_wrong(instances: list[Path]) -> None:
    verified = analyze("verify", *map(str, instances))
    assert (verified.returncode, verified.stderr) == (0, "")


@needs_systemd
def test_systemd_would_find_a_misspelt_setting(instances: list[Path]) -> None:
    unit = instances[0]
    unit.write_text(unit.read_text("utf-8").replace("WatchdogSec=", "WatchdogSeconds="), "utf-8")
    assert "Unknown key" in analyze("verify", str(unit)).stderr


@needs_systemd
def test_no_unit_is_more_exposed_than_it_must_be(instances: list[Path]) -> None:
    for unit in instances:
        judged = analyze("security", "--offline=true", f"--threshold={MOST_EXPOSED * 10:.0f}", str(unit))
        assert judged.returncode == 0, judged.stdout


@needs_systemd
def test_the_calls_that_a_real_time_process_makes_are_allowed() -> None:
    listed = analyze("syscall-filter", "@system-service", "@resources", "@privileged").stdout
    groups = {part.splitlines()[0]: part for part in listed.split("\n@") if part}
    resources = next(text for name, text in groups.items() if name.strip("@ ") == "resources")
    assert "sched_setscheduler" in resources
    for unit in SIDES[:2]:
        refused = [line for line in settings(unit)["SystemCallFilter"] if line.startswith("~")]
        assert "@resources" not in " ".join(refused)
        assert "RestrictRealtime" not in settings(unit)


@pytest.mark.parametrize("unit", SIDES)
def test_what_runs_is_a_command_that_tandem_has(unit: str) -> None:
    [start] = settings(unit)["ExecStart"]
    program, command, file = start.split()
    assert program == INSTALLED
    assert command in {
        str(c.name or getattr(c.callback, "__name__", "")) for c in cli.app.registered_commands
    }
    assert file.startswith("/etc/tandem/")


def test_the_recorder_reaches_the_tap_and_its_folder_and_nothing_else() -> None:
    service = settings("tandem-record@.service")
    [start] = service["ExecStart"]
    assert start == f"{INSTALLED} record --config /etc/tandem/%i.toml"
    assert service["RestrictAddressFamilies"] == ["AF_UNIX"]
    assert service["PrivateNetwork"] == ["yes"]
    for unit in (*SIDES[:2], "tandem-record@.service"):
        assert settings(unit)["RuntimeDirectory"] == ["tandem"]
        assert settings(unit)["RuntimeDirectoryPreserve"] == ["yes"], "one that stops takes no other's socket"


@pytest.mark.parametrize("unit", SIDES)
def test_a_stop_is_sigterm_and_outlasts_the_process_s_deadline(unit: str) -> None:
    service = settings(unit)
    assert service["KillSignal"] == ["SIGTERM"]
    stop_s = float(service["TimeoutStopSec"][0])
    assert SHUTDOWN_S < stop_s <= 2 * SHUTDOWN_S  # else systemd kills what is about to end by itself


@pytest.mark.parametrize("unit", SIDES)
def test_a_failure_is_restarted_but_not_for_ever(unit: str) -> None:
    service, limits = settings(unit), settings(unit, "Unit")
    assert service["Restart"] == ["on-failure"]
    assert service["Type"] == ["notify"]
    restart_s, burst = float(service["RestartSec"][0]), int(limits["StartLimitBurst"][0])
    assert restart_s * burst < float(limits["StartLimitIntervalSec"][0])  # else the limit is never reached
    assert float(service["WatchdogSec"][0]) / PINGS_A_PERIOD >= 0.25  # a ping costs a tick next to nothing


@pytest.mark.parametrize("unit", SIDES[:2])
def test_the_priority_that_a_file_may_ask_for_is_permitted(unit: str) -> None:
    most = next(m.le for m in ProcessConfig.model_fields["realtime_priority"].metadata if hasattr(m, "le"))
    assert int(settings(unit)["LimitRTPRIO"][0]) >= most


@pytest.mark.parametrize("unit", SIDES)
def test_it_can_change_nothing_but_its_own_folder(unit: str) -> None:
    service = settings(unit)
    assert service["ProtectSystem"] == ["strict"]
    assert service["NoNewPrivileges"] == service["PrivateTmp"] == service["ProtectHome"] == ["yes"]
    assert service["User"] == ["tandem"]
    assert service["CapabilityBoundingSet"] == [""]
    assert service["WorkingDirectory"] == [f"/var/lib/{service['StateDirectory'][0]}"]


@pytest.mark.parametrize("unit", SIDES[:2])
def test_the_buses_can_be_reached(unit: str) -> None:
    families = settings(unit)["RestrictAddressFamilies"][0].split()
    assert {"AF_CAN", "AF_NETLINK", "AF_INET", "AF_INET6", "AF_UNIX"} == set(families)


def test_the_two_ways_to_set_a_bus_up_say_the_same() -> None:
    network = (FOLDER / "network" / "80-tandem-can.network").read_text("utf-8")
    keys = dict(re.findall(r"^(\w+)=(.+)$", network, re.MULTILINE))
    [options] = settings("tandem-can@.service")["Environment"]
    words = options.strip('"').split("=", 1)[1].split()
    by_ip = dict(zip(words[::2], words[1::2], strict=True))
    assert float(by_ip["bitrate"]) == 1e6 * float(keys["BitRate"].removesuffix("M"))
    assert float(by_ip["dbitrate"]) == 1e6 * float(keys["DataBitRate"].removesuffix("M"))
    assert (by_ip["fd"], keys["FDMode"]) == ("on", "yes")
    assert f"{by_ip['restart-ms']}ms" == keys["RestartSec"]


@needs_systemd
def test_the_user_is_one_that_systemd_sysusers_makes(tmp_path: Path) -> None:
    sysusers = shutil.which("systemd-sysusers")
    if sysusers is None:
        pytest.skip("no systemd-sysusers here")
    (tmp_path / "etc").mkdir()
    made = subprocess.run(
        [sysusers, f"--root={tmp_path}", str(FOLDER / "tandem.sysusers")],
        capture_output=True, text=True, check=False, timeout=60,
    )  # fmt: skip
    assert made.returncode == 0, made.stderr
    assert re.search(r"^tandem:.*nologin$", (tmp_path / "etc/passwd").read_text("utf-8"), re.MULTILINE)


def test_analysis_of_the_security_report_is_in_machine_words(instances: list[Path]) -> None:
    if shutil.which("systemd-analyze") is None:
        pytest.skip("no systemd-analyze: apt install systemd")
    report = json.loads(analyze("security", "--offline=true", "--json=short", str(instances[0])).stdout)
    exposed = {row["json_field"] for row in report if row["set"] is False}
    assert "NoNewPrivileges" not in exposed
