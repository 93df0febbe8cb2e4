"""Recordings: what is put is read back, killed or not; what cannot be written is counted; nobody waits."""

from __future__ import annotations

import errno
import io
import os
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import pytest

from common.errors import RecordingError
from common.recording import McapRecorder, read_recording

METADATA = {"profile": "nursing", "rate_hz": "200"}

ZSTD = b"\x28\xb5\x2f\xfd"
"""How a compressed chunk begins."""


def test_what_is_put_is_read_back_in_order_with_both_times(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with McapRecorder(path, METADATA, wall=iter(range(10**18, 10**18 + 9)).__next__) as recorder:
        for i in range(3):
            assert recorder.put("suit", bytes([i]) * 5, 100 + i)
        recorder.put("other", b"x", 7)
    assert recorder.counters.written == recorder.counters.put == 4
    recording = read_recording(path)
    assert recording.metadata == METADATA
    assert recording.cut == ""
    assert [tuple(e) for e in recording.entries] == [
        ("suit", b"\0" * 5, 10**18, 100),
        ("suit", b"\1" * 5, 10**18 + 1, 101),
        ("suit", b"\2" * 5, 10**18 + 2, 102),
        ("other", b"x", 10**18 + 3, 7),
    ]


def test_any_reader_of_mcap_finds_its_index(tmp_path: Path) -> None:
    from mcap.reader import make_reader

    path = tmp_path / "a.mcap"
    with McapRecorder(path, METADATA) as recorder:
        recorder.put("suit", b"payload", 1)
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == 1


WRITER = """
import sys, time
from pathlib import Path
from common.recording import McapRecorder
recorder = McapRecorder(Path(sys.argv[1]), {"profile": "nursing"})
i = 0
while True:
    recorder.put("suit", i.to_bytes(8, "little") + bytes(1300), time.monotonic_ns())
    print(i, time.monotonic_ns(), flush=True)
    i += 1
    time.sleep(0.005)
"""


def test_a_killed_process_loses_less_than_a_second(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    writer = subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE, text=True)
    assert writer.stdout is not None
    said = []
    try:
        for line in writer.stdout:
            said.append([int(word) for word in line.split()])
            if said[-1][1] - said[0][1] > 1_600_000_000:
                break
    finally:
        writer.kill()
    said += [[int(word) for word in line.split()] for line in writer.stdout if line.count(" ") == 1]
    writer.wait()
    writer.stdout.close()
    recording = read_recording(path)
    assert "cut off" in recording.cut
    numbers = [int.from_bytes(entry.payload[:8], "little") for entry in recording.entries]
    assert numbers == list(range(len(numbers)))
    assert len(numbers) > 50
    assert said[-1][1] - recording.entries[-1].monotonic_ns < 1_000_000_000


@pytest.fixture(scope="module")
def chunks(tmp_path_factory: pytest.TempPathFactory) -> tuple[bytes, int]:
    """A file of several chunks, and how many messages it has."""
    path = tmp_path_factory.mktemp("whole") / "a.mcap"
    recorder = McapRecorder(path, METADATA, flush_s=0.0)  # a chunk a message
    for i in range(20):
        recorder.put("suit", i.to_bytes(8, "little") + os.urandom(50), i)
    recorder.close()
    return path.read_bytes(), 20


def test_a_file_cut_anywhere_gives_a_whole_beginning_or_is_refused(
    chunks: tuple[bytes, int], tmp_path: Path
) -> None:
    content, count = chunks
    path = tmp_path / "cut.mcap"
    longest = 0
    for length in range(0, len(content), 7):
        path.write_bytes(content[:length])
        try:
            recording = read_recording(path)
        except RecordingError:
            assert longest == 0
            continue
        numbers = [int.from_bytes(entry.payload[:8], "little") for entry in recording.entries]
        assert numbers == list(range(len(numbers)))
        assert len(numbers) >= longest
        assert recording.cut
        longest = len(numbers)
    assert longest == count


def test_a_damaged_chunk_ends_the_recording_before_it(chunks: tuple[bytes, int], tmp_path: Path) -> None:
    content = bytearray(chunks[0])
    content[content.index(ZSTD, len(content) // 3) + 20] ^= 0xFF
    path = tmp_path / "bad.mcap"
    path.write_bytes(content)
    recording = read_recording(path)
    assert recording.cut
    assert 0 < len(recording.entries) < chunks[1]


def test_a_file_that_is_there_is_never_written_over(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(b"precious")
    with pytest.raises(RecordingError, match="is there already"):
        McapRecorder(path, METADATA)
    assert path.read_bytes() == b"precious"


def in_another_process(path: Path, before: str) -> subprocess.CompletedProcess[str]:
    """Run some lines, then begin a recording."""
    body = f"{before}\nMcapRecorder(Path({str(path)!r}), {{'profile': 'nursing'}})"
    program = f"import os\nfrom pathlib import Path\nfrom common.recording import McapRecorder\n{body}"
    return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)


KILLED = """
from mcap.writer import Writer
Writer.{step} = lambda *_, **__: os.kill(os.getpid(), 9)
"""


@pytest.mark.parametrize("step", ["start", "add_metadata", "flush"])
def test_killed_before_its_head_is_written_it_leaves_no_file(step: str, tmp_path: Path) -> None:
    ended = in_another_process(tmp_path / "a.mcap", KILLED.format(step=step))
    assert ended.returncode == -9, ended.stderr
    assert not list(tmp_path.glob("*.mcap"))


def test_killed_after_its_head_is_written_it_leaves_a_file_that_can_be_read(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    # the recorder's thread is started right after the head
    ended = in_another_process(
        path, "import threading\nthreading.Thread.start = lambda _: os.kill(os.getpid(), 9)"
    )
    assert ended.returncode == -9, ended.stderr
    assert read_recording(path).metadata == {"profile": "nursing"}
    assert list(tmp_path.iterdir()) == [path]


def test_a_disk_that_is_full_from_the_beginning_leaves_no_file(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    ended = in_another_process(path, "import resource\nresource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))")
    assert "RecordingError" in ended.stderr
    assert "cannot be written (File too large)" in ended.stderr
    assert not list(tmp_path.iterdir())


def test_without_hard_links_a_file_gets_its_name_all_the_same_and_replaces_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.mcap"

    def no_link(*_: object) -> None:
        raise PermissionError(errno.EPERM, os.strerror(errno.EPERM))

    monkeypatch.setattr(os, "link", no_link)
    with McapRecorder(path, METADATA) as recorder:
        recorder.put("suit", b"x", 1)
    whole = path.read_bytes()
    with pytest.raises(RecordingError, match="is there already"):
        McapRecorder(path, METADATA)
    assert path.read_bytes() == whole
    assert list(tmp_path.iterdir()) == [path]


def test_no_folder_no_recording(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"nowhere/a.mcap: cannot be written"):
        McapRecorder(tmp_path / "nowhere" / "a.mcap", METADATA)


@pytest.mark.parametrize("content", [b"", b"not mcap at all", b"\x89MCAP0\r\n"])
def test_what_is_no_recording_is_refused(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=r"not an MCAP file|not a recording"):
        read_recording(path)


class FullDisk(io.BytesIO):
    """Takes the beginning, then no more."""

    def write(self, data: Any) -> int:
        if self.tell() > 500:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return super().write(data)


def test_a_full_disk_is_said_once_and_the_process_goes_on(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    recorder = McapRecorder(tmp_path / "a.mcap", METADATA, flush_s=0.0, stream=FullDisk())
    for i in range(200):
        recorder.put("suit", os.urandom(100), i)
    recorder.close()
    recorder.put("suit", b"after", 201)
    counters = recorder.counters
    assert counters.failed == os.strerror(errno.ENOSPC)
    assert counters.put == 201
    assert 0 < counters.written < 200
    assert counters.refused + counters.lost == counters.put - counters.written
    assert len([r for r in caplog.records if "the recording ends here" in r.message]) == 1


class Hanging(io.BytesIO):
    """A disk that takes its time, until it is let go."""

    def __init__(self) -> None:
        super().__init__()
        self.go = threading.Event()
        self.hang = False

    def flush(self) -> None:
        if self.hang:
            self.go.wait()


def test_a_disk_that_hangs_delays_nobody_and_the_overflow_is_counted(tmp_path: Path) -> None:
    disk = Hanging()
    recorder = McapRecorder(tmp_path / "a.mcap", METADATA, flush_s=0.0, capacity=10, stream=disk)
    disk.hang = True
    taken = [recorder.put("suit", b"x", i) for i in range(100)]
    assert taken[0]
    assert taken.count(False) >= 80
    assert recorder.counters.refused == taken.count(False)
    disk.go.set()
    recorder.close()
    assert recorder.counters.written == taken.count(True)
