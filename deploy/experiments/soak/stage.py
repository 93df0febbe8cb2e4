"""The processes of a soak: suit, master, slave, recorder; start, kill and stop them, give the suit faults."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping, Sequence
from dataclasses import replace

from common.clock import monotonic_ns
from common.errors import LinkError, TandemError
from common.wire.topics import FAULTS
from deploy.experiments.soak import recorder as recording
from deploy.experiments.soak.files.happenings import ProcessStarted, RecordingChecked
from deploy.experiments.soak.recorder import RecorderProcess
from deploy.experiments.soak.watch import Record, Watch
from deploy.harness.child import Child, Usage
from deploy.harness.rig import ROBOT, Rig


class Stage:
    """The processes by name, and which of them are to run."""

    def __init__(self, rig: Rig, watch: Watch, record: Record) -> None:
        self.rig = rig
        self.watch = watch
        self.record = record
        child = Child("record", rig.folder, name=recording.NAME)
        self.recorder = RecorderProcess(child, rig.folder, rig.endpoints.observing, ROBOT)
        self.children: dict[str, Child] = {**rig.children, recording.NAME: child}
        self.meant = {name for name, child in self.children.items() if child.running}
        """Processes that are to run; a router runs already."""

    @property
    def names(self) -> list[str]:
        """The names of all processes, in the order of the display."""
        return sorted(self.children, key=lambda name: (name == recording.NAME, name))

    async def start(self, name: str, through: Sequence[str] = ()) -> None:
        """Start a process, or again."""
        self.watch.restarted(name)
        if name == recording.NAME:
            await self.recorder.start(through)
        else:
            await self.rig.start(name, through)
        self.meant.add(name)
        self.record(ProcessStarted(name, self.children[name].lifetime))

    async def kill(self, name: str) -> int:
        """Kill it; returns when, by this host's clock."""
        self.meant.discard(name)
        at_ns = monotonic_ns()
        await self.children[name].kill()
        return at_ns

    async def stop(self, name: str) -> int | None:
        """Stop it; its exit status."""
        self.meant.discard(name)
        return await self.children[name].stop()

    async def inject_suit_faults(self, faults: str) -> None:
        """Give the suit's nodes these faults, as TOML. Raises TandemError where it does not take them."""
        for _ in range(3):
            try:
                await self.rig.link().ask(FAULTS, faults.encode())
            except LinkError as error:
                refused = error
                await asyncio.sleep(0.2)
            else:
                return
        raise TandemError(f"the suit does not take its faults: {refused}")

    def ended(self) -> list[str]:
        """Processes that ended by themselves since the last call; they are no longer among those to run."""
        gone = [name for name in sorted(self.meant) if not self.children[name].running]
        self.meant.difference_update(gone)
        return gone

    def usage(self) -> Mapping[str, tuple[int, Usage]]:
        """Which life each running process is in, and what it uses."""
        used = {name: (child.lifetime, child.usage) for name, child in self.children.items()}
        return {name: (life, use) for name, (life, use) in used.items() if use is not None}

    async def check_recording(self, after: str, ended_ns: int | None = None) -> RecordingChecked:
        """What is in the file of the recorder that has just ended; `ended_ns`: when it was killed."""
        return replace(await self.recorder.look(ended_ns), after=after)

    async def close(self) -> dict[str, int | None]:
        """Stop all, the recorder and the master first; exit statuses."""
        statuses = {recording.NAME: await self.stop(recording.NAME)}
        self.meant.clear()
        statuses |= await self.rig.stop()
        await self.recorder.disk.remove()
        return statuses
