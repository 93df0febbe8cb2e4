"""A live robot's topics go into a file as they came, and the file says what is in it."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any

import pytest
import uvloop
from typer.testing import CliRunner

from common.errors import ConfigError, RecordingError, TandemError
from common.link import open_link
from common.link.config import LinkConfig
from common.metrics.recorder import RecorderMetrics
from common.metrics.tree import Metrics
from common.recording import McapRecorder, read_recording
from common.wire.topics import COMMAND, STATE, STATISTICS, video
from deploy import cli
from deploy.client.observer import link_of
from deploy.ops.record.record import RecordOptions, record
from deploy.recorded.contents import survey
from tests.deploy.ops.record.numbered import state

ROBOT = "robot-1"


def run(test: Callable[[], Coroutine[Any, Any, None]]) -> None:
    async def bounded() -> None:
        async with asyncio.timeout(30):
            await test()

    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        runner.run(bounded())


def free_endpoint() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


def test_where_to_listen_in_is_said_by_endpoints_or_by_a_file(tmp_path: Path) -> None:
    assert link_of(["tcp/127.0.0.1:1"], None).connect == ["tcp/127.0.0.1:1"]
    file = tmp_path / "observer.toml"
    file.write_text('[link]\nmode = "client"\nconnect = ["tcp/127.0.0.1:2"]\n')
    link = link_of([], file)
    assert (link.mode, link.connect) == ("client", ["tcp/127.0.0.1:2"])
    with pytest.raises(TandemError, match="where is the robot"):
        link_of([], None)
    file.write_text("[link]\nspeed = 3\n")
    with pytest.raises(ConfigError, match=r"observer\.toml: link\.speed = 3: expected no such key"):
        link_of([], file)


def test_every_topic_is_recorded_as_it_came_until_stopped(tmp_path: Path) -> None:
    async def test() -> None:
        endpoint, stop, out = free_endpoint(), asyncio.Event(), tmp_path / "a.mcap"
        options = RecordOptions(LinkConfig(connect=[endpoint]), ROBOT, out, cameras=("head",))
        told: list[str] = []
        counted: list[Metrics] = []
        async with open_link(LinkConfig(listen=[endpoint]), ROBOT) as robot:
            puts = {
                topic: robot.publish(topic)
                for topic in (COMMAND.of("anna"), STATE, STATISTICS, video("head"))
            }
            recording = asyncio.create_task(record(options, stop, told.append, counted.append))
            while not told or any(
                name not in told[-1] for name in ("command", "state", "statistics", "video")
            ):
                for topic, put in puts.items():
                    put(topic.name.encode())
                await asyncio.sleep(0.01)
            stop.set()
            said = await recording
        assert said.startswith(f"{out}: ")
        read = read_recording(out)
        assert read.cut == ""
        assert read.metadata["robot"] == ROBOT
        assert {e.topic: e.payload for e in read.entries} == {
            "tandem/robot-1/operator/anna/command": b"command",
            "tandem/robot-1/state": b"state",
            "tandem/robot-1/statistics": b"statistics",
            "tandem/robot-1/video/head": b"video",
        }
        (metrics,) = counted
        assert isinstance(metrics, RecorderMetrics)
        assert metrics.written == len(read.entries) == sum(metrics.recorded.values())

    run(test)


def test_an_absent_robot_is_reported_and_the_file_is_whole(tmp_path: Path) -> None:
    async def test() -> None:
        out = tmp_path / "a.mcap"
        options = RecordOptions(LinkConfig(connect=[free_endpoint()]), ROBOT, out, seconds=0.05)
        with pytest.raises(TandemError, match="nothing was heard of robot-1: is it running"):
            await record(options, asyncio.Event(), lambda _: None)
        assert survey(out).topics == {}

    run(test)


def test_commands_that_nobody_sends_there_are_missed_in_words(tmp_path: Path) -> None:
    async def test() -> None:
        endpoint, stop, told = free_endpoint(), asyncio.Event(), list[str]()
        options = RecordOptions(LinkConfig(connect=[endpoint]), ROBOT, tmp_path / "a.mcap")
        async with open_link(LinkConfig(listen=[endpoint]), ROBOT) as robot:
            put = robot.publish(STATE)
            recording = asyncio.create_task(record(options, stop, told.append))
            while not told or "state" not in told[-1]:
                put(b"state")
                await asyncio.sleep(0.01)
            stop.set()
            assert "no commands: connect to where the master listens too" in await recording

    run(test)


def written(path: Path) -> None:
    with McapRecorder(path, {"robot": ROBOT}) as recorder:
        for i in range(5):
            recorder.put(
                "tandem/robot-1/state", bytes(10), i * 1_000_000_000 + (3_000_000_000 if i == 4 else 0)
            )


def test_the_contents_are_counted_topic_by_topic(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    written(path)
    state = survey(path).topics["tandem/robot-1/state"]
    assert (state.count, state.size, state.longest_gap_s) == (5, 50, 4.0)
    assert state.rate_hz == pytest.approx(4 / 7)


def test_the_command_shows_them_and_where_a_file_was_cut_off(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    written(path)
    whole = CliRunner().invoke(cli.app, ["inspect", str(path)])
    assert whole.exit_code == 0
    assert "tandem/robot-1/state" in whole.output
    assert "cut off" not in whole.output
    path.write_bytes(path.read_bytes()[:-30])
    assert "cut off" in CliRunner().invoke(cli.app, ["inspect", str(path)]).output


def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_text("something else")
    with pytest.raises(RecordingError, match="not an MCAP file"):
        survey(path)


@pytest.mark.parametrize("may_miss", [False, True])
def test_states_that_never_came_are_reported_as_an_error(tmp_path: Path, may_miss: bool) -> None:
    async def test() -> None:
        endpoint, stop, told = free_endpoint(), asyncio.Event(), list[str]()
        counted: list[Metrics] = []
        options = RecordOptions(LinkConfig(connect=[endpoint]), ROBOT, tmp_path / "a.mcap", may_miss=may_miss)
        async with open_link(LinkConfig(listen=[endpoint]), ROBOT) as robot:
            put = robot.publish(STATE)
            recording = asyncio.create_task(record(options, stop, told.append, counted.append))
            while not told or "state" not in told[-1]:
                put(state(7))
                await asyncio.sleep(0.01)
            while "MISSING: " not in told[-1]:
                put(state(2208))
                await asyncio.sleep(0.01)
            stop.set()
            if may_miss:
                assert "MISSING: 2200 of tandem/robot-1/state" in await recording
            else:
                with pytest.raises(
                    TandemError, match=r"missing by their own numbers: 2200 of tandem/robot-1"
                ):
                    await recording
        (metrics,) = counted
        assert isinstance(metrics, RecorderMetrics)
        assert metrics.missing == {"tandem/robot-1/state": 2200}

    run(test)


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (["--tap", "m.sock", "--robot", "robot-1"], "--robot"),
        (["--tap", "m.sock", "--connect", "tcp/127.0.0.1:1", "--video", "head"], "--connect, --video"),
        (["--config", "master.toml", "--tap", "m.sock"], "--tap"),
    ],
)
def test_options_that_mean_nothing_beside_a_source_are_refused(
    tmp_path: Path, options: list[str], named: str
) -> None:
    out = [] if "--config" in options else ["--out", str(tmp_path / "a.mcap")]
    refused = CliRunner().invoke(cli.app, ["record", *options, *out])
    assert isinstance(refused.exception, TandemError)
    assert f"leave out {named}" in str(refused.exception)
    assert not list(tmp_path.iterdir())
