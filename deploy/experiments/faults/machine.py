"""What a robot tells wrongly of itself: two masters at its drives, spoiled frames of its instrument."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from common.clock import NS_PER_S, to_s
from common.quaternion import Array
from common.wire.messages import BaseAttitude
from deploy.experiments.faults.scene import Scene
from slave.attitude.config import BaseConfig
from slave.attitude.frame import FrameAngles, FrameParser, encode
from slave.attitude.port import of_frame
from slave.attitude.vote import Vote
from slave.guard.body import Body
from slave.guard.tilt import base_loss
from slave.servos.canopen.config import CanopenConfig
from slave.servos.canopen.drives import Drives
from slave.servos.canopen.pdo import SYNC

FRAMES_HZ = 10.0
"""Of the instrument: the slowest that one may be."""
FALLS_DEG_S = 100.0


def second_master(scene: Scene) -> None:
    """Another program sends SYNC on a bus of the drives, which NMT then stops: they brake and hold."""
    drives = Drives(CanopenConfig(), scene.skeleton)
    drives.start(scene.run.slave_ns)
    drives.on_frame("left", SYNC, b"", scene.run.slave_ns)
    held: list[Array] = []

    def write(position_rad: Array) -> Array:
        held.append(position_rad)
        return held[0]

    scene.run.troubles.write = write
    scene.run.troubles.body = lambda: Body(drives=drives.faults)


def frames_spoiled(scene: Scene) -> None:
    """Every fourth frame of the instrument has one flipped bit, another one each time; the base stands."""
    flips = np.random.default_rng(5)

    def spoil(frame: bytes, number: int) -> bytes:
        bit = int(flips.integers(8, 56))
        spoiled = bytearray(frame)
        spoiled[bit // 8] ^= (1 << bit % 8) * (number % 4 == 3)
        return bytes(spoiled)

    _instrument(scene, lambda _: 0.0, spoil)


def base_falls(scene: Scene) -> None:
    """The base tips over at 100°/s, as an instrument of ten frames a second tells it."""
    _instrument(scene, lambda at_s: min(90.0, FALLS_DEG_S * at_s), lambda frame, _: frame)


def _instrument(
    scene: Scene, lean_deg: Callable[[float], float], on_wire: Callable[[bytes, int], bytes]
) -> None:
    """From now on the base's attitude is what an instrument's frames say, read as the slave reads them."""
    config = BaseConfig(source="serial", port="-")
    guard = scene.run.slave_config.guard
    parser, vote = FrameParser(), Vote(math.radians(config.most_deg_s))
    told: list[BaseAttitude] = []
    began_ns = scene.run.slave_ns
    period_ns = round(NS_PER_S / FRAMES_HZ)
    sent = -3

    def body() -> Body:
        nonlocal sent
        now_ns = scene.run.slave_ns
        # the three before the fault: an instrument that has been told already
        while began_ns + sent * period_ns <= now_ns:
            came_ns = began_ns + sent * period_ns
            lean = round(10.0 * lean_deg(max(0.0, to_s(came_ns - began_ns)))) % 3600
            for angles in parser.feed(on_wire(encode(FrameAngles(900, 0, lean)), max(0, sent))):
                heard = vote.hear(angles, came_ns)
                found = None if heard is None else of_frame(heard.angles, heard.came_ns, config)
                told[:] = told if found is None else [found]
            sent += 1
        return Body(base=base_loss(told[0] if told else None, now_ns, guard))

    scene.run.troubles.body = body
