"""Leads a person through a proof at the master's tap, and records it meanwhile."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path

import msgpack

from common.clock import monotonic_ns
from common.errors import TandemError
from common.process.runtime import until_stopped
from common.recording import McapRecorder
from common.tap.message import GREETING
from common.tap.reader import TapReader
from deploy.experiments.prove.guide import ProofGuide, ProofStep, ProofView
from deploy.experiments.prove.recorded import NodeRates
from deploy.recorded.recorded_config import recorded_config
from master.journal.calls import MISSING
from master.suit.protocol import SuitProtocol

GREETED_S = 5.0
LOOKS_S = 0.1


async def lead(
    tap: Path,
    out: Path,
    hand: str,
    node: int,
    seconds: float,
    stop: asyncio.Event,
    show: Callable[[ProofView], None],
) -> bool:
    """Until the hand has moved for so long, or `stop` is set; whether it was led to its end.

    The recording is `out`. Raises TandemError where there is no master's tap, or it ends.
    """
    with TapReader(tap) as reader:
        head = await _head(reader)
        with recorded_config(head, str(tap)) as config:
            if hand not in config.nodes:
                raise TandemError(f"--hand {hand}: expected a segment with a node: {', '.join(config.nodes)}")
            if node in {one.id for one in config.nodes.values()}:
                raise TandemError(
                    f"--node {node}: a segment's own node has this number; expected one that none has"
                )
            protocol, worn = SuitProtocol.load(config.capture.dbc), config.nodes[hand]
            robot = (config.commanded or ["ROBOT"])[0]
        guide = ProofGuide(
            NodeRates(protocol, worn.id, worn.bus), NodeRates(protocol, node), hand, node, seconds,
            f"tandem engage --robot {robot}",
        )  # fmt: skip
        with McapRecorder(out, head) as recorder:
            await until_stopped(stop, _lead(reader, recorder, guide, show))
        return guide.step is ProofStep.DONE


async def _head(reader: TapReader) -> dict[str, str]:
    try:
        first = await asyncio.wait_for(reader.read(), GREETED_S)
        head = msgpack.unpackb(first.payload) if first.topic == GREETING else {}
    except TimeoutError:
        head = {}
    if head.get("role") != "master":
        raise TandemError(f"{reader.path}: expected the [tap] socket of a master, as only it has the nodes")
    return dict(head)


async def _lead(
    reader: TapReader, recorder: McapRecorder, guide: ProofGuide, show: Callable[[ProofView], None]
) -> None:
    taking = asyncio.create_task(_take(reader, recorder, guide))
    try:
        while guide.step is not ProofStep.DONE:
            show(guide.look(monotonic_ns()))
            done, _ = await asyncio.wait({taking}, timeout=LOOKS_S)
            if done:
                taking.result()  # raises why the tap ended
    finally:
        taking.cancel()


async def _take(reader: TapReader, recorder: McapRecorder, guide: ProofGuide) -> None:
    missed = 0
    while True:
        message = await reader.read()
        if reader.missed > missed:
            missed = reader.missed
            recorder.put(MISSING, b"", message.stamp_ns)
        recorder.put(message.topic, message.payload, message.stamp_ns)
        guide.take(message.topic, message.payload, monotonic_ns())
