"""`tandem doctor` as a person types it: files to needs, findings to a table, JSON and an exit status."""

from __future__ import annotations

import asyncio
import io
import json
import sys
from pathlib import Path

import pytest
from rich.console import Console

from common.errors import ConfigError, TandemError
from deploy import cli
from deploy.ops.doctor.examine import Options, devices, examine
from deploy.ops.doctor.judge.finding import Health, fail, ok, warn, worst
from deploy.ops.doctor.judge.needs import CameraNeed, Needs, needs_of
from deploy.ops.doctor.read.tree import Tree
from deploy.ops.doctor.view import as_table, as_tree, in_words
from master.suit.protocol import SHIPPED_DBC, SuitProtocol

EXAMPLES = Path(cli.__file__).parent / "examples"


def test_a_master_s_file_tells_buses_robots_and_name() -> None:
    needs = needs_of(EXAMPLES / "master.toml")
    assert (needs.role, needs.robots, needs.certified_as) == ("master", ("robot-1",), "operator:nurse-1")
    assert [(need.bus.name, need.nodes, need.rate_hz) for need in needs.buses] == [("suit", 36, 200)]
    assert needs.realtime_priority == 20


def test_two_dbc_messages_of_one_identifier_are_refused_at_the_start(
    tmp_path: Path,
) -> None:
    text = SHIPPED_DBC.read_text("utf-8")
    line = next(line for line in text.splitlines() if line.startswith("BO_ ") and " SYNC:" in line)
    number = SuitProtocol.load().answer_format(fd=True).parts[0].base_id + 5
    crowded = tmp_path / "crowded.dbc"
    crowded.write_text(text.replace(f" {line.split()[1]} ", f" {number} "), "utf-8")
    with pytest.raises(ConfigError, match=f"{number:#x}.*NODE_SAMPLE of node 5 and SYNC"):
        needs_of(EXAMPLES / "master.toml", [f'capture.dbc="{crowded}"'])


def test_a_slave_s_file_tells_its_ports_and_camera() -> None:
    instrument = ['base.source="serial"', 'base.port="/dev/ttyUSB3"']
    needs = needs_of(EXAMPLES / "slave.toml", instrument)
    assert (needs.role, needs.certified_as) == ("slave", "robot:robot-1")
    assert needs.serial_ports == ("/dev/ttyUSB3",)
    assert needs.camera is CameraNeed.DRAWN
    assert needs.buses == ()
    drives = needs_of(EXAMPLES / "slave.toml", ['servos.backend="canopen"'])
    assert [need.bus.name for need in drives.buses] == ["left", "right"]


def test_each_camera_of_a_slave_s_file_is_looked_at(tmp_path: Path) -> None:
    beside = '[[camera]]\nsource = "v4l2"\nname = "room"\ndevice = "/dev/video7"\n'
    text = (EXAMPLES / "slave.toml").read_text("utf-8").replace("[camera]", "[[camera]]")
    (tmp_path / "slave.toml").write_text(f"{text}\n{beside}", "utf-8")
    found = devices(needs_of(tmp_path / "slave.toml"), Tree(tmp_path))
    assert [one.check for one in found if one.check.startswith("camera")] == ["camera", "camera room"]
    assert found[-1].health is not Health.OK


def test_a_suit_s_file_is_known_too() -> None:
    assert needs_of(EXAMPLES / "suit.toml").role == "suit"


def test_files_that_are_none_are_said_so(tmp_path: Path) -> None:
    with pytest.raises(TandemError, match="readable TOML file"):
        needs_of(tmp_path / "none.toml")
    (tmp_path / "bad.toml").write_text("robot = ", "utf-8")
    with pytest.raises(TandemError, match="readable TOML file"):
        needs_of(tmp_path / "bad.toml")
    (tmp_path / "wrong.toml").write_text("speed = 1", "utf-8")
    with pytest.raises(ConfigError, match="speed"):
        needs_of(tmp_path / "wrong.toml")


FOUND = [ok("cores", "4"), warn("load", "7.0", "see `top`"), fail("bus suit", "can0 is down", "bring it up")]


def test_the_report_says_what_was_found_and_what_to_do() -> None:
    text = io.StringIO()
    Console(file=text, width=80).print(as_table(FOUND))
    assert all(part in text.getvalue() for part in ("can0 is down", "→ bring it up", "fail", "→ see `top`"))
    tree = json.loads(json.dumps(as_tree("master", FOUND)))
    assert tree["health"] == "fail"
    assert tree["checks"][0] == {"check": "cores", "health": "ok", "found": "4", "do": None}
    assert in_words("master", FOUND) == "master: 1 fail, 1 warn, 1 ok"


def test_the_worst_decides() -> None:
    assert [worst(FOUND[:n]) for n in range(4)] == [Health.OK, Health.OK, Health.WARN, Health.FAIL]


@pytest.mark.parametrize("fails", [True, False])
def test_the_exit_status_is_1_only_where_something_fails(
    fails: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    # a CAN interface that no host has, or none at all
    bus = 'interface="socketcan"' if fails else 'interface="virtual"'
    line = ["doctor", str(EXAMPLES / "master.toml"), "--no-reach", "--json"]
    line += ["--set", f"capture.buses.0.{bus}", "--set", 'capture.buses.0.channel="nosuch0"']
    monkeypatch.setattr(sys, "argv", ["tandem", *line])
    with pytest.raises(SystemExit) as left:
        cli.main()
    said = capsys.readouterr()
    tree = json.loads(said.out)
    bus_row = next(check for check in tree["checks"] if check["check"] == "bus suit")
    assert bus_row["health"] == ("fail" if fails else "ok")
    if fails:
        assert left.value.code == 1
        assert "not ready" in said.err
    else:
        # whatever else ails this machine is not of this test
        assert (left.value.code == 0) == (tree["health"] != "fail")


def test_a_router_s_file_is_known_by_having_nothing_else() -> None:
    needs = needs_of(EXAMPLES / "router.toml")
    assert (needs.role, needs.certified_as) == ("router", "router:router-1")
    assert needs.link.listen == ["tcp/0.0.0.0:7448"]


def test_drives_that_the_file_lets_tell_no_effort_are_named(tmp_path: Path) -> None:
    needs = needs_of(
        EXAMPLES / "slave.toml", ['servos.backend="canopen"', "servos.canopen.tell_effort=false"]
    )
    assert len(needs.no_effort) == 25
    assert needs_of(EXAMPLES / "slave.toml", ['servos.backend="canopen"']).no_effort == {}
    assert len(needs_of(EXAMPLES / "dynamixel.toml").no_effort) == 25
    found = asyncio.run(examine(Needs(no_effort={"left_thumb": "so"}), Options(reach=False), Tree(tmp_path)))
    (finding,) = [one for one in found if one.check == "contact"]
    assert finding.health is Health.WARN
    assert finding.found == "no contact detection: left_thumb tells no effort: so"
