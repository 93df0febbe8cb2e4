"""Leads a person at the suit through the ten steps, and records them."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from common.errors import TandemError
from common.recording.node import NodeRecording
from deploy.calibrate import capture as shared
from deploy.measure.person.judge import PersonJudgement, judge_person
from deploy.measure.person.steps import LOOKED_AT, STEP_S, STEPS
from master.calibrate.recording import load_recordings
from master.config import MasterConfig
from master.suit.sweep import Sweep

Show = Callable[[str], None]


async def lead_and_record(config: MasterConfig, out: Path, language: str, show: Show) -> None:
    """Two minutes. Raises TandemError where the bus or the disk fails, or nobody answers."""
    recorder = shared.open_recorder(config, out)
    ticks = 0

    def on_sweep(sweep: Sweep) -> None:
        nonlocal ticks
        ticks += 1
        shared.record(recorder, sweep)

    capture = shared.open_capture(config, on_sweep)
    polling = asyncio.create_task(capture.run())
    try:
        for number, step in enumerate(STEPS):
            show(f"{number + 1} of {len(STEPS)}, {STEP_S:.0f} s: {step.text.get(language, step.text['en'])}")
            # by the suit's own ticks: the recording is cut into steps by them
            while ticks < (number + 1) * STEP_S * config.capture.rate_hz:
                await asyncio.wait({polling}, timeout=0.1)
                if polling.done():
                    polling.result()
                    raise TandemError("the suit's bus ended")
    finally:
        polling.cancel()
        await asyncio.gather(polling, return_exceptions=True)
        await asyncio.to_thread(recorder.close)
    shared.check_written(recorder)


def judge_recording(path: Path, config: MasterConfig, led: bool) -> PersonJudgement:
    """Of the nodes that recording and suit both have; refused where one that the steps move is not recorded.

    Raises RecordingError, TandemError.
    """
    skeleton = config.skeleton
    names = skeleton.segment_names
    nodes: dict[str, NodeRecording] = {
        name: node for name, node in load_recordings(path).items() if name in names
    }
    if not nodes:
        raise TandemError(f"{path}: no node of it is one of the {config.profile} profile's segments")
    parents = {
        name: names[parent]
        for name, parent in zip(names, skeleton.parents.tolist(), strict=True)
        if parent >= 0
    }
    worn = LOOKED_AT.intersection(names) - config.suit.without_node.keys()
    lacking = tuple(sorted(worn - nodes.keys()))
    return replace(judge_person(nodes, parents, led), lacking=lacking)
