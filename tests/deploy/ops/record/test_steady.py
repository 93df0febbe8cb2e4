"""The recorder that runs for good: it waits, begins again, keeps its bounds, survives a full disk."""

from __future__ import annotations

import asyncio
import json
import re
from collections.abc import Awaitable, Callable
from pathlib import Path

import msgpack
import pytest

from common.clock import NS_PER_S
from common.config.load import load_config
from common.errors import ConfigError, TandemError
from common.recording import read_recording
from common.recording.config import RecordingConfig
from common.tap.sender import TapSender
from deploy.ops.record.from_tap import _Marking
from deploy.ops.record.retention import SEAL, WRITTEN, KeptFile, remove, to_remove
from deploy.ops.record.steady import ROOM_BYTES, SteadyOptions, _name, record_steadily, steady_options
from deploy.study.marks import MARK_TOPIC, NOW_TOPIC, MarkKind, write_mark
from deploy.study.session import SESSION, begin
from deploy.study.under_way import say_under_way
from master.config import MasterConfig

EXAMPLES = Path(__file__).parents[4] / "deploy/examples"
CUP = EXAMPLES / "study" / "cup.toml"
HOUR_NS = 3600 * NS_PER_S


def files(*sizes: int) -> list[KeptFile]:
    """One an hour, the last the newest."""
    return [KeptFile(Path(f"{i}.mcap"), size, i * HOUR_NS) for i, size in enumerate(sizes)]


@pytest.mark.parametrize(
    ("config", "gone"),
    [
        (RecordingConfig(), []),
        (RecordingConfig(keep_gb=3.0), ["0", "1"]),
        (RecordingConfig(keep_gb=4.0), ["0"]),
        (RecordingConfig(keep_gb=5.0), []),
        (RecordingConfig(keep_gb=0.1), ["0", "1", "2", "3"]),
        (RecordingConfig(max_hours=2.5), ["0", "1"]),
        (RecordingConfig(max_hours=0.1), ["0", "1", "2", "3"]),
    ],
)
def test_the_oldest_go_and_the_newest_always_stays(config: RecordingConfig, gone: list[str]) -> None:
    five = files(*[1_000_000_000] * 5)
    assert [file.path.stem for file in to_remove(five, config, 4 * HOUR_NS)] == gone


def test_only_its_own_files_go_and_none_of_a_sealed_folder(tmp_path: Path) -> None:
    begun = "20261130T081500.123Z"
    others = (
        f"robot-{begun}.mcap", f"operator-2-{begun}.mcap", f"operator-{begun}.toml", "operator-kept.mcap",
    )  # fmt: skip
    for name in (f"operator-{begun}.mcap", f"operator-{begun}-2.mcap", *others):
        (tmp_path / name).write_bytes(b"x" * 1000)
    config = RecordingConfig(keep_gb=1e-9)
    (tmp_path / SEAL).write_text("{}")
    assert remove(tmp_path, "operator", config, 0) == []
    (tmp_path / SEAL).unlink()
    assert len(remove(tmp_path, "operator", config, 0)) == 1
    assert {path.name for path in tmp_path.iterdir()} >= set(others)
    options = SteadyOptions(tmp_path / "s.sock", tmp_path, "operator", config)
    assert re.fullmatch(rf"operator-{WRITTEN}", _name(options, 1_700_000_000_000_000_000).name)


def test_the_file_is_read_and_what_is_missing_is_said(tmp_path: Path) -> None:
    def options(*lines: str) -> SteadyOptions:
        file = tmp_path / "operator.toml"
        file.write_text("\n".join(["robots = ['r']", *lines]))
        return steady_options(file)

    tap = f"[tap]\nsocket = '{tmp_path}/s.sock'"
    with pytest.raises(TandemError, match=r"\[recording\] folder is not set"):
        options(tap)
    with pytest.raises(ConfigError, match=r"recording.folder .* a folder that exists"):
        options(tap, "[recording]\nfolder = 'nowhere'")
    with pytest.raises(ConfigError, match=r"tap\.socket .* a path"):
        options(f"[recording]\nfolder = '{tmp_path}'")
    found = options(tap, f"[recording]\nfolder = '{tmp_path}'\nkeep_gb = 2.0")
    assert (found.name, found.config.keep_gb) == ("operator", 2.0)


def test_a_master_s_file_takes_the_section_and_starts_without_its_folder(tmp_path: Path) -> None:
    tap = f'tap.socket="{tmp_path}/s.sock"'
    config = load_config(EXAMPLES / "master.toml", MasterConfig, (tap, 'recording.folder="/not/mounted"'))
    assert config.recording.folder == Path("/not/mounted")
    with pytest.raises(ConfigError, match=r"tap\.socket"):
        load_config(EXAMPLES / "master.toml", MasterConfig, ('recording.folder="/tmp"',))


Story = Callable[[Path, "Recorder"], Awaitable[None]]


class Recorder:
    """A recorder under way, and the room on its disk."""

    def __init__(self) -> None:
        self.room = 10 * ROOM_BYTES
        self.told: list[str] = []

    async def until(self, condition: Callable[[], bool]) -> None:
        async with asyncio.timeout(20.0):
            while True:
                if condition():
                    return
                await asyncio.sleep(0.005)


def play(folder: Path, story: Story) -> list[Path]:
    """Run a story beside a recorder; the files that it leaves, in order."""
    recorder, socket = Recorder(), folder / "s.sock"
    options = SteadyOptions(socket, folder, "operator", RecordingConfig(folder=folder))

    async def whole() -> None:
        stop = asyncio.Event()
        running = asyncio.create_task(
            record_steadily(
                options, stop, recorder.told.append, room=lambda _: recorder.room, retry_s=(0.01, 0.01)
            )
        )
        await story(socket, recorder)
        stop.set()
        await running

    asyncio.run(whole())
    return sorted(folder.glob("operator-*.mcap"))


async def a_run(socket: Path, recorder: Recorder, count: int) -> None:
    """A process that hands on some messages and ends."""
    sender = TapSender(socket, lambda: msgpack.packb({"role": "master"}))
    sender.open()
    await recorder.until(lambda: sender.count == 1)
    for number in range(count):
        sender.put("t", number.to_bytes(4, "big"), number)
        await asyncio.sleep(0.001)
    sender.close()
    await asyncio.sleep(0.05)


def test_each_start_of_the_process_begins_a_file(tmp_path: Path) -> None:
    async def story(socket: Path, recorder: Recorder) -> None:
        await recorder.until(lambda: any("waiting" in told for told in recorder.told))
        await a_run(socket, recorder, 50)
        await a_run(socket, recorder, 70)

    found = play(tmp_path, story)
    assert [len(read_recording(path).entries) for path in found] == [50, 70]
    assert not any(read_recording(path).cut for path in found)


def test_a_disk_without_room_is_waited_for(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    async def story(socket: Path, recorder: Recorder) -> None:
        recorder.room = ROOM_BYTES - 1
        sender = TapSender(socket, lambda: msgpack.packb({"role": "master"}))
        sender.open()
        await asyncio.sleep(0.1)
        assert sender.count == 0
        sender.close()
        recorder.room = ROOM_BYTES
        await a_run(socket, recorder, 30)

    found = play(tmp_path, story)
    assert [len(read_recording(path).entries) for path in found] == [30]
    assert [record.message for record in caplog.records].count(
        f"{tmp_path}: no room on the disk; recording goes on once there is"
    ) == 1


def test_a_disk_that_fails_in_the_middle_ends_the_file_and_not_the_recorder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from common.recording import McapRecorder

    flush, failing = McapRecorder._flush, [False]

    def full(recorder: McapRecorder) -> None:
        if failing[0]:
            raise OSError(28, "No space left on device")
        flush(recorder)

    monkeypatch.setattr(McapRecorder, "_flush", full)

    async def story(socket: Path, recorder: Recorder) -> None:
        sender = TapSender(socket, lambda: msgpack.packb({"role": "master"}))
        sender.open()
        number = 0

        def put(files: int) -> bool:
            nonlocal number
            number += 1
            sender.put("t", number.to_bytes(4, "big"), number)
            return len(list(tmp_path.glob("operator-*.mcap"))) == files

        await recorder.until(lambda: put(1))
        failing[0] = True
        await recorder.until(lambda: put(2) or sender.count == 0)
        failing[0] = False
        await recorder.until(lambda: put(2))
        for _ in range(20):
            put(2)
        await asyncio.sleep(0.05)
        sender.close()

    found = play(tmp_path, story)
    assert len(found) == 2
    assert read_recording(found[0]).metadata == {"role": "master"}, "it can be read as far as it goes"
    assert len(read_recording(found[1]).entries) >= 20


def test_marks_in_the_folder_and_of_the_session_under_way_are_recorded_within_its_consent(
    tmp_path: Path,
) -> None:
    """As a page's F4 writes them; the subject has not consented to video."""
    study = tmp_path / "study"
    session = begin(study, CUP, "k7pd")
    say_under_way(session)
    options = SteadyOptions(tmp_path / "m.sock", tmp_path, "m", RecordingConfig(), study)

    async def story() -> None:
        sender, stop = TapSender(options.socket, lambda: msgpack.packb({"role": "master"})), asyncio.Event()
        sender.open()
        recording = asyncio.create_task(record_steadily(options, stop, lambda _: None))
        async with asyncio.timeout(30.0):
            while not list(tmp_path.glob("*.mcap")):  # noqa: ASYNC110, ASYNC240  # a file, in a test
                await asyncio.sleep(0.02)
            write_mark(tmp_path, MarkKind.EVENT, "page")
            session.next_step()
            for _ in range(80):
                sender.put("suit/frames", b"frame")
                sender.put("tandem/robot-1/video/head", b"picture")
                await asyncio.sleep(0.02)
        stop.set()
        await recording
        sender.close()

    asyncio.run(story())
    [file] = tmp_path.glob("*.mcap")
    entries = read_recording(file).entries
    marks = [json.loads(entry.payload) for entry in entries if entry.topic == MARK_TOPIC]
    assert {(mark["kind"], mark["text"]) for mark in marks} == {("event", "page"), ("step", "rest")}
    now = [json.loads(entry.payload) for entry in entries if entry.topic == NOW_TOPIC]
    assert now[-1] == {"subject": "k7pd", "session": "01", "scope": ["motion"], "step": "rest"}
    topics = [entry.topic for entry in entries]
    last = len(topics) - 1 - topics[::-1].index("suit/frames")
    assert "tandem/robot-1/video/head" not in topics[topics.index(NOW_TOPIC) : last]


def test_while_it_is_not_known_who_is_recorded_no_picture_is(tmp_path: Path) -> None:
    """Consent cannot be looked up: the file of the session that is under way is damaged."""
    study = tmp_path / "study"
    session = begin(study, CUP, "k7pd", scope=("motion", "video"))
    say_under_way(session)
    marking = _Marking(tmp_path, None, study)
    head = (session.path / SESSION).read_text()
    for written, video in ((head, True), ("{", False), (head, True)):
        (session.path / SESSION).write_text(written)
        marking.take(0)
        assert marking.may_record("tandem/robot-1/video/head") is video
        assert marking.may_record("suit/frames")


def test_a_session_without_video_that_has_just_begun_lets_no_picture_pass(tmp_path: Path) -> None:
    """The marks are looked for twice a second, and each picture is one too many."""
    study = tmp_path / "study"
    marking = _Marking(tmp_path, None, study)
    marking.take(0)
    assert marking.may_record("tandem/robot-1/video/head"), "no session is under way"
    say_under_way(begin(study, CUP, "k7pd", scope=("motion",)))
    assert not marking.may_record("tandem/robot-1/video/head")
    assert marking.may_record("suit/frames")
