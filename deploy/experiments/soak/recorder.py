"""The recorder's process within a soak: a new file each time, checked when it is closed."""

from __future__ import annotations

import asyncio
import json
import shutil
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from common.clock import monotonic_ns, to_ns, to_s
from common.errors import CodecError, RecordingError, TandemError
from common.link.config import LinkConfig
from common.metrics.tree import from_tree
from common.recording import RecordingStream
from deploy.experiments.soak.files.happenings import RecordingChecked
from deploy.harness.child import Child
from deploy.harness.spawn import finished

NAME = "recorder"
FULL_BYTES = 40 * 1024
"""A disk of this size is full after about 4 s: commands, states and statistics are 10 kB/s, compressed."""
ENDS_HERE = "the recording ends here"
"""What the recorder logs once when its disk fails."""
WRITES_S = 30.0
"""A recorder whose file has no message after this is a fault that cannot be brought about."""
LOOK_S = 0.1


@dataclass(frozen=True, slots=True)
class RecordedTopic:
    """What the soak reads about one topic from `tandem inspect --json`."""

    last_ns: int
    count: int


@dataclass(frozen=True, slots=True)
class RecordedContents:
    """What the soak reads about a file from `tandem inspect --json`."""

    topics: Mapping[str, RecordedTopic] = field(default_factory=dict)
    cut: str = ""
    error: str = ""
    """Why the file could not be read."""


class RecorderProcess:
    """Starts and ends `tandem record` of one robot. Its files lie in `folder` until they are checked."""

    def __init__(self, child: Child, folder: Path, link: LinkConfig, robot: str) -> None:
        """`link`: where commands and states are received."""
        self.child = child
        self._folder = folder
        self._link = folder / f"{NAME}.toml"
        self._link.write_text(_toml(link), "utf-8")
        # the soak's own faults make messages miss; what matters there is judged from the robot's figures
        self._arguments = [
            "--link",
            str(self._link),
            "--robot",
            robot,
            "--minutes-per-file",
            "1",
            "--may-miss",
        ]
        self._number = 0
        self._logged_before = 0
        self.file = folder / "none.mcap"
        self.disk = SmallDisk(folder / "full")

    async def start(self, through: Sequence[str] = (), folder: Path | None = None) -> None:
        """Record into a new file."""
        self._number += 1
        self._logged_before = len(self.child.log_text()) if self.child.log.exists() else 0
        self.file = (folder or self._folder) / f"recording-{self._number:04}.mcap"
        await self.child.run([*self._arguments, "--out", str(self.file)], through)

    async def start_on_small_disk(self) -> str:
        """Record onto a disk that will be full soon; returns how the disk was limited."""
        where, through, how = await self.disk.make()
        await self.start(through, where)
        return how

    async def until_it_writes(self, within_s: float = WRITES_S) -> None:
        """Return once a message is in the file of this life: only then can a kill or a full disk cost one.

        Raises TandemError where none is after `within_s`.
        """
        until_ns = monotonic_ns() + to_ns(within_s)
        while not _has_message(self.file):
            if monotonic_ns() >= until_ns:
                raise TandemError(f"the recorder has written no message within {within_s:g} s: {self.file}")
            await asyncio.sleep(LOOK_S)

    def complaints(self) -> int:
        """How often this process logged that its disk failed."""
        return self.child.log_text()[self._logged_before :].count(ENDS_HERE)

    async def look(self, ended_ns: int | None = None) -> RecordingChecked:
        """What the process that has ended wrote last; all its files are deleted. `ended_ns`: when it died."""
        files = sorted(
            self.file.parent.glob(f"{self.file.stem}*.mcap"), key=lambda file: file.stat().st_mtime
        )
        contents = await _contents(files[-1] if files else self.file)
        if not contents.topics and not contents.error and len(files) > 1:
            contents = await _contents(files[-2])  # the newest was begun less than a flush before the end
        size_mb = sum(file.stat().st_size for file in files) / 1e6
        for file in files:
            file.unlink()
        topics = contents.topics.values()
        last_ns = max((topic.last_ns for topic in topics), default=None)
        lost_s = None if ended_ns is None or last_ns is None else max(0.0, to_s(ended_ns - last_ns))
        return RecordingChecked(
            readable=bool(topics),
            messages=sum(topic.count for topic in topics),
            size_mb=size_mb,
            cut=contents.cut,
            lost_s=lost_s,
            why_not=contents.error or ("" if topics else f"{self.file.name}: no message is in it"),
        )

    async def kill(self) -> int:
        """Kill it; returns when, by this host's clock."""
        at_ns = monotonic_ns()
        await self.child.kill()
        return at_ns


def _toml(link: LinkConfig) -> str:
    import tomlkit

    tree = link.model_dump(mode="json", exclude_defaults=True, exclude={"listen"})
    return tomlkit.dumps({"link": tree})


class SmallDisk:
    """A file system of its own where the host permits it, else a limit on the size of the process's files."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._mounted = False

    async def make(self) -> tuple[Path, tuple[str, ...], str]:
        """Where to write, the command to run the process through, and a description. Raises TandemError."""
        self._folder.mkdir(exist_ok=True)
        size = f"size={FULL_BYTES // 1024}k"
        if await _succeeds("mount", "-t", "tmpfs", "-o", size, "tmpfs", str(self._folder)):
            self._mounted = True
            return self._folder, (), f"a file system of {FULL_BYTES // 1024} KiB"
        if shutil.which("prlimit"):
            limit = ("prlimit", f"--fsize={FULL_BYTES}", "--")
            return self._folder, limit, f"a limit of {FULL_BYTES // 1024} KiB a file (nothing may be mounted)"
        raise TandemError("a disk cannot be filled here: nothing may be mounted, and there is no `prlimit`")

    async def remove(self) -> None:
        """May be called at any time."""
        if self._mounted:
            self._mounted = not await _succeeds("umount", str(self._folder))
        with suppress(OSError):
            self._folder.rmdir()


def _has_message(file: Path) -> bool:
    try:
        return next(iter(RecordingStream(file)), None) is not None
    except RecordingError:
        return False


async def _contents(file: Path) -> RecordedContents:
    """Read in another process: a long recording must cost the soak neither memory nor time."""
    nice = ("nice", "-n", "15") if shutil.which("nice") else ()
    _, out, err = await finished([*nice, sys.executable, "-m", "deploy", "inspect", str(file), "--json"])
    try:
        return from_tree(RecordedContents, json.loads(out))
    except CodecError as error:
        return RecordedContents(error=str(error))
    except ValueError:
        return RecordedContents(error=err.decode("utf-8", "replace").strip())


async def _succeeds(*command: str) -> bool:
    return shutil.which(command[0]) is not None and (await finished(command))[0] == 0
