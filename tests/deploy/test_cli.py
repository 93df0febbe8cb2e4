"""What a person types and gets back: examples in every help, one clear line for every mistake."""

from __future__ import annotations

import asyncio
import os
import re
import shlex
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

import pytest
from typer.testing import CliRunner

from common.errors import TandemError
from deploy import cli
from deploy.experiments.demo import run as demo_run
from deploy.report.panels import PANELS

EXAMPLES = Path(cli.__file__).parent / "examples"
COMMANDS = sorted(str(command.name or command.callback.__name__) for command in cli.app.registered_commands)  # type: ignore[union-attr]

Said = tuple[int | str | None, str]
Tandem = Callable[[str], Said]


@pytest.fixture
def tandem(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Tandem:
    """Type a command line; its exit status and what it said to stderr."""

    def typed(line: str) -> Said:
        monkeypatch.setattr(sys, "argv", ["tandem", *shlex.split(line)])
        with pytest.raises(SystemExit) as left:
            cli.main()
        return left.value.code, capsys.readouterr().err

    return typed


def shown(*arguments: str) -> str:
    """The output of a help, its box and line breaks taken out."""
    result = CliRunner().invoke(cli.app, [*arguments], terminal_width=200, env={"NO_COLOR": "1"})
    return re.sub(r"[\s│]+", " ", result.output)


def test_alone_it_prints_its_help() -> None:
    for arguments in ((), ("--help",)):
        help_text = shown(*arguments)
        assert "Start with tandem demo" in help_text
        assert all(f" {command} " in help_text for command in COMMANDS)


def test_every_command_stands_under_a_heading_once() -> None:
    groups = [str(group.name) for group in cli.app.registered_groups]
    placed = [name for names in PANELS.values() for name in names]
    assert len(placed) == len(set(placed))
    assert {*COMMANDS, *groups} <= set(placed)  # a new command: give it a place in deploy/report/panels.py
    help_text = CliRunner().invoke(cli.app, ["--help"], terminal_width=100, env={"NO_COLOR": "1"}).output
    headings = re.findall(r"╭─ ([A-Z][a-z ]+?) ─", help_text)
    assert [heading for heading in headings if heading != "Options"] == list(PANELS)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_s_help_has_an_example_that_it_would_take(command: str) -> None:
    help_text = shown(command, "--help")
    example = re.search(rf"Example: tandem {command}( .*?)(?= ╭| Arguments| Options|$)", help_text)
    assert example, help_text
    options = set(re.findall(r" (--[a-z-]+)", example.group(1)))
    described = help_text.replace(example.group(0), "")
    assert all(option in described for option in options)


@pytest.mark.parametrize(
    ("line", "parts"),
    [
        ("master nosuch.toml", ["nosuch.toml: file = 'nosuch.toml': expected a readable file (No such"]),
        (f"master {EXAMPLES}", [f"{EXAMPLES}: file = ", "expected a readable file (Is a directory)"]),
        (f"master {EXAMPLES}/master.toml --set speed=1", ["master.toml: speed = 1: expected no such key"]),
        (
            f"slave {EXAMPLES}/slave.toml --set track.strategy=3",
            ["track.strategy = 3: expected a valid string"],
        ),
        (f"slave {EXAMPLES}/slave.toml --set track", ["--set = 'track': expected section.key=value"]),
        (f"slave {EXAMPLES}/slave.toml --set robot=r2", ["--set: robot = 'r2': expected a TOML value"]),
        (f"slave {EXAMPLES}/slave.toml --set robot.name=2", ["robot.name = '2': expected a key of a table"]),
        (
            f"suit {EXAMPLES}/suit.toml --set 'replay=\"nosuch.npz\"'",
            [f"{EXAMPLES}/nosuch.npz: replay = ", "expected a readable npz file", "there is no such file"],
        ),
        (
            "demo --transport carrier-pigeon",
            ["--transport = 'carrier-pigeon': expected one of tcp, udp, tls, quic, quic-datagram, ws, "],
        ),
        (
            "demo --profile octopus",
            ["skeleton: profile = 'octopus': expected one of hand, lower_limb, nursing"],
        ),
        (
            "demo --profile hand --motion bottle",
            ["hand/suit.toml: motion = 'bottle': expected one of grasp, "],
        ),
        (
            "status --connect nowhere --robot r",
            ["connect.0 = 'nowhere': expected a protocol out of tcp, udp"],
        ),
        ("status --connect tcp/127.0.0.1:1 --robot a/b", ["robot 'a/b': expected a name"]),
        ("status --robot a", ["where is the robot?", "--connect", "--master"]),
        ("engage --connect tcp/127.0.0.1:1 --operator a", ["which robot?", "--robot"]),
        ("engage --connect tcp/127.0.0.1:1 --robot a", ["which operator?", "--operator"]),
        ("estop --connect tcp/127.0.0.1:1", ["which robot?", "--all"]),
        ("status --master nosuch.toml", ["nosuch.toml: file = 'nosuch.toml': expected a readable file"]),
    ],
)
def test_a_mistake_is_one_line_and_status_1(tandem: Tandem, line: str, parts: list[str]) -> None:
    status, said = tandem(line)
    assert status == 1
    assert len(said.splitlines()) == 1, said
    assert said.startswith("tandem: ")
    for part in parts:
        assert part in said


def test_a_file_of_the_other_side_is_one_line_naming_the_key(tandem: Tandem) -> None:
    status, said = tandem(f"slave {EXAMPLES}/master.toml")
    assert status == 1
    lines = said.splitlines()
    assert [re.sub(r".*master\.toml: (\w+) = .*", r"\1", line) for line in lines] == [
        "robot",
        "robots",
        "operator",
        "capture",
        "estimation",
        "alarms",
        "nodes",
    ]
    assert all(len(line) < 300 for line in lines)


@pytest.mark.parametrize(
    "command", ["demo --report", "bench --report", f"slave {EXAMPLES}/slave.toml --metrics"]
)
def test_a_report_that_could_not_be_written_is_said_before_the_work(
    tandem: Tandem, command: str, tmp_path: Path
) -> None:
    status, said = tandem(f"{command} {tmp_path}/no/report.json")
    assert status == 2
    assert "there is no folder" in said


def test_a_picture_of_another_kind_is_refused_before_the_work(tandem: Tandem) -> None:
    status, said = tandem("demo --profile hand --plots fingers.jpg")
    assert status == 2
    assert "expected a name that ends in .png" in said


@pytest.mark.parametrize("line", ["--debug master nosuch.toml", "master nosuch.toml --debug"])
def test_debug_before_or_after_the_command_shows_the_traceback(
    monkeypatch: pytest.MonkeyPatch, line: str
) -> None:
    monkeypatch.setattr(sys, "argv", ["tandem", *line.split()])
    with pytest.raises(TandemError):
        cli.main()


@pytest.mark.parametrize("line", ["--debug --quiet bench", "--debug bench --quiet"])
def test_debug_and_quiet_exclude_each_other(tandem: Tandem, line: str) -> None:
    assert tandem(line) == (1, "tandem: --debug and --quiet: expected only one of the two\n")


@pytest.mark.parametrize("command", [*COMMANDS, "calibrate imu", "trial serve", "keys make"])
def test_every_command_takes_debug_and_quiet(command: str) -> None:
    help_text = shown(*command.split(), "--help")
    assert "--debug" in help_text
    assert "--quiet" in help_text


@pytest.mark.usefixtures("default_signals")
def test_ctrl_c_in_a_demo_is_one_line(tandem: Tandem, monkeypatch: pytest.MonkeyPatch) -> None:
    async def story(_: object, stop: asyncio.Event, __: object) -> NoReturn:
        os.kill(os.getpid(), signal.SIGINT)
        await stop.wait()
        raise TandemError("the suit ended with status 0: stopped")

    monkeypatch.setattr(demo_run, "_story", story)
    assert tandem("demo") == (1, "tandem: interrupted: nothing was judged\n")


def test_a_process_that_fails_without_ctrl_c_is_named(
    tandem: Tandem, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def story(*_: object) -> NoReturn:
        raise TandemError("the suit ended with status 1: no such bus")

    monkeypatch.setattr(demo_run, "_story", story)
    assert tandem("demo") == (1, "tandem: the suit ended with status 1: no such bus\n")
