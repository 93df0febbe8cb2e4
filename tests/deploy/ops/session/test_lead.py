"""A session with a real recorder at a real tap: marks are in the recording, video only with consent."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path

import msgpack
import pytest
from typer.testing import CliRunner

from common.errors import TandemError
from common.recording import McapRecording, read_recording
from common.tap.sender import TapSender
from deploy import cli
from deploy.examples import profiles
from deploy.ops.session.run import lead
from deploy.study.marks import MARK_TOPIC, NOW_TOPIC, MarkKind
from deploy.study.session import Session, begin
from deploy.study.under_way import session_under_way

CUP = Path(profiles.__file__).parent / "study" / "cup.toml"
VIDEO = "tandem/robot-1/video/head"


def played(
    root: Path, scope: tuple[str, ...], dies: bool = False
) -> tuple[Session, McapRecording, list[str]]:
    """Two steps and an event while a tap speaks; `dies`: the process ends first."""
    session, shown = begin(root, CUP, "k7pd", scope=scope), list[str]()

    async def story() -> None:
        sender = TapSender(root / "operator.sock", lambda: msgpack.packb({"role": "master"}))
        sender.open()
        leading = asyncio.create_task(lead(session, [sender.path], asyncio.Event(), shown.append, "zh"))

        async def until(condition: object) -> None:
            async with asyncio.timeout(60.0):
                while not condition():  # type: ignore[operator]  # a function without arguments
                    sender.put("suit/frames", b"frame")
                    sender.put(VIDEO, b"picture")
                    await asyncio.sleep(0.01)

        await until(lambda: (session.path / "operator.mcap").exists())
        session.next_step()
        await until(lambda: any("rest" in line for line in shown))
        session.mark(MarkKind.EVENT, "cup dropped")
        await until(lambda: any("cup dropped" in line for line in shown))
        if dies:
            sender.close()
        else:
            session.mark(MarkKind.END, "done")
        try:
            await leading
        finally:
            sender.close()

    try:
        asyncio.run(story())
    finally:
        recording = read_recording(session.path / "operator.mcap")
    return session, recording, shown


def test_marks_steps_and_consent_are_in_the_recording(tmp_path: Path) -> None:
    session, recording, shown = played(tmp_path, ("motion",))
    assert recording.metadata["study_subject"] == "k7pd"
    assert recording.metadata["study_scope"] == "motion"
    marks = [json.loads(entry.payload) for entry in recording.entries if entry.topic == MARK_TOPIC]
    assert [(mark["kind"], mark["text"]) for mark in marks] == [
        ("step", "rest"), ("event", "cup dropped"), ("end", "done"),
    ]  # fmt: skip
    topics = {entry.topic for entry in recording.entries}
    assert "suit/frames" in topics
    assert VIDEO not in topics
    now = [json.loads(entry.payload) for entry in recording.entries if entry.topic == NOW_TOPIC]
    assert {(one["subject"], one["session"]) for one in now} == {("k7pd", "01")}
    assert now[-1]["step"] in ("", "rest")
    assert session_under_way(tmp_path) is None, "it is over"
    assert not recording.cut
    assert any("请站立不动" in line for line in shown)
    assert session.ended


def test_with_consent_there_is_video(tmp_path: Path) -> None:
    _, recording, _ = played(tmp_path, ("motion", "video"))
    assert VIDEO in {entry.topic for entry in recording.entries}


def test_recorders_are_ended_where_the_disk_takes_no_mark(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Recorders:
        stopped = False

        def __init__(self, *_: object) -> None: ...

        async def start(self) -> None: ...

        async def ended(self) -> str:
            await asyncio.Event().wait()
            return ""

        async def stop(self) -> dict[str, str]:
            Recorders.stopped = True
            return {}

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    session, stop, shown = begin(tmp_path, CUP, "k7pd"), asyncio.Event(), list[str]()
    monkeypatch.setattr("deploy.ops.session.run.SessionRecorders", Recorders)
    monkeypatch.setattr(Session, "mark", full)
    stop.set()
    asyncio.run(lead(session, [], stop, shown.append, "en"))
    assert Recorders.stopped
    assert "its end is not marked" in shown[-1]


def test_a_session_is_sealed_only_once_it_has_ended(tmp_path: Path) -> None:
    session = begin(tmp_path, CUP, "k7pd")
    early = CliRunner().invoke(cli.app, ["session", "seal", str(session.path)])
    assert "has not ended" in str(early.exception)
    session.mark(MarkKind.END, "done")
    assert CliRunner().invoke(cli.app, ["session", "seal", str(session.path)]).exit_code == 0
    assert CliRunner().invoke(cli.app, ["session", "verify", str(session.path)]).exit_code == 0


def test_a_process_that_ends_ends_the_session_with_an_error(tmp_path: Path) -> None:
    with pytest.raises(TandemError, match="the recorder of operator ended"):
        played(tmp_path, ("motion",), dies=True)
    session = Session(tmp_path / "sub-k7pd/ses-01")
    assert session.ended
