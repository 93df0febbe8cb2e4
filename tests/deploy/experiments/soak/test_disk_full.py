"""The recorder around a full disk: it runs afterwards whatever came of it, and its end is not hidden."""

from __future__ import annotations

import asyncio
import random
from typing import cast

import pytest

from common.errors import TandemError
from deploy.experiments.soak.faults import FAULTS, FaultCase
from deploy.experiments.soak.files.happenings import RecordingChecked
from deploy.experiments.soak.stage import Stage

FULL = FAULTS["disk-full"]


class FakeRecorder:
    """Of a process, only whether it runs and in which life."""

    def __init__(self, small_disk: bool) -> None:
        self._small_disk = small_disk
        self.child = self.disk = self
        self.running, self.lifetime = True, 1

    async def start(self) -> None:
        self.running, self.lifetime = True, self.lifetime + 1

    async def start_on_small_disk(self) -> str:
        if not self._small_disk:
            raise TandemError("a disk cannot be filled here")
        await self.start()
        return "a small one"

    async def until_it_writes(self) -> None:
        if not self.running:
            raise TandemError("the recorder does not run")

    def complaints(self) -> int:
        return 1

    async def remove(self) -> None:
        pass


class FakeStage:
    """What the fault does to the stage, without a process."""

    def __init__(self, small_disk: bool = True) -> None:
        self.recorder = FakeRecorder(small_disk)
        self.meant: set[str] = {"recorder"}
        self.checked: dict[str, RecordingChecked] = {}

    async def stop(self, name: str) -> int:
        self.recorder.running = False
        self.meant.discard(name)
        return 0

    async def start(self, name: str) -> None:
        await self.recorder.start()
        self.meant.add(name)

    async def check_recording(self, after: str) -> RecordingChecked:
        return RecordingChecked(after)

    def record(self, what: RecordingChecked) -> None:
        self.checked[what.after] = what


def case_on(stage: FakeStage) -> FaultCase:
    return FaultCase(cast(Stage, stage), random.Random(1))


async def begun(stage: FakeStage) -> None:
    await FULL.begin(case_on(stage))


def test_a_disk_that_cannot_be_filled_leaves_the_recorder_running() -> None:
    stage = FakeStage(small_disk=False)
    with pytest.raises(TandemError, match="cannot be filled"):
        asyncio.run(begun(stage))
    assert stage.recorder.running
    assert stage.meant == {"recorder"}


@pytest.mark.parametrize("ends", [False, True])
def test_a_recorder_that_ended_on_a_full_disk_did_not_live(
    ends: bool,
) -> None:
    async def story() -> FakeStage:
        stage = FakeStage()
        case = case_on(stage)
        await FULL.begin(case)
        if ends:
            await stage.start("recorder")  # as the soak does with each process that ends by itself
        await FULL.end(case)
        return stage

    stage = asyncio.run(story())
    assert stage.checked["disk full"].lived is not ends
    assert stage.recorder.running
