"""Frames of three other makers' units become readings in the sensor's axes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from common.quaternion import angle_between
from deploy.sim.suit.free_running import FreeNode, NodeClock, Reading
from master.capture.decode import LayoutDecoder, NodeSamples
from master.capture.layout import MappedLayout
from master.capture.parts import ACC, COUNTER, GYR, MAG, STAMP, TURN

Load = Callable[..., MappedLayout]
Swing = Callable[..., Reading]


class Wire:
    """One node, and the decoder that hears it."""

    def __init__(self, layout: MappedLayout, reading: Reading, number: int = 1) -> None:
        self.node = FreeNode(layout, number, reading, NodeClock(100.0))
        self.sends = layout.by_node[number]
        self.decoder = LayoutDecoder(layout, self.sends, [0])
        self.ids = [part.message.frame_id + self.sends.step for part in self.sends.parts]

    def send(self, index: int, without: tuple[int, ...] = (), now_ns: int = 0) -> None:
        for place, frame in enumerate(self.node.frames(index)):
            if place not in without:
                self.decoder.frame(self.ids.index(frame.id), frame.data, now_ns)

    def take(self) -> NodeSamples:
        samples = self.decoder.take()
        assert samples is not None
        return samples


@pytest.mark.parametrize(
    ("name", "acc", "gyr", "mag_ut", "turn_rad"),
    [("mti", 0.002, 0.001, 0.03, None), ("lpms", 0.005, 0.001, None, 2e-4), ("bno", 0.002, None, None, 1e-4)],
)
def test_a_sample_holds_what_the_sensor_read(
    load: Load,
    swing: Swing,
    name: str,
    acc: float,
    gyr: float | None,
    mag_ut: float | None,
    turn_rad: float | None,
) -> None:
    wire = Wire(load(name, 1), swing(3))
    wire.send(50)
    values = wire.take().values[-1]
    readings, q = swing(3)(0.5)
    assert np.abs(values[ACC] - readings[:3]).max() <= acc
    if gyr is None:
        assert np.isnan(values[GYR]).all()
    else:
        assert np.abs(values[GYR] - readings[3:6]).max() <= gyr
    if mag_ut is None:
        assert np.isnan(values[MAG]).all()
    else:
        assert np.abs(values[MAG] - readings[6:]).max() <= mag_ut
    if turn_rad is None:
        assert np.isnan(values[TURN]).all()
    else:
        assert angle_between(values[TURN], q) <= turn_rad


def test_own_times_and_counts_are_read(load: Load, swing: Swing) -> None:
    wire = Wire(load("mti", 1), swing(1))
    wire.send(7)
    assert wire.take().values[0, STAMP] == pytest.approx(0.07)
    wire = Wire(load("lpms", 1), swing(1))
    for index in range(3):
        wire.send(index)
    assert wire.take().values[:, COUNTER].tolist() == [0.0, 1.0, 2.0]


@pytest.mark.parametrize("lost", [0, 1, 2])
def test_a_lost_frame_loses_its_sample_and_mixes_no_two(load: Load, swing: Swing, lost: int) -> None:
    wire = Wire(load("lpms", 1), swing(2))
    wire.send(0)
    wire.send(1, without=(lost,))
    wire.send(2)
    wire.send(3)
    samples = wire.take()
    assert samples.values[:, COUNTER].tolist() == [0.0, 2.0, 3.0]
    for place, index in enumerate((0, 2, 3)):
        readings, _ = swing(2)(index / 100.0)
        assert np.abs(samples.values[place, ACC] - readings[:3]).max() <= 0.005
        assert np.abs(samples.values[place, GYR] - readings[3:6]).max() <= 0.001


def test_a_short_frame_changes_nothing_and_is_counted(load: Load, swing: Swing) -> None:
    wire = Wire(load("lpms", 1), swing(2))
    for place, frame in enumerate(wire.node.frames(0)):
        wire.decoder.frame(wire.ids.index(frame.id), frame.data[:-1] if place == 1 else frame.data, 0)
    assert wire.decoder.take() is None
    assert wire.decoder.take() is None
    assert wire.decoder.short.tolist() == [1]


def test_a_quaternion_that_is_none_is_no_orientation(load: Load, swing: Swing) -> None:
    wire = Wire(load("bno", 2), swing(2), number=2)
    frames = wire.node.frames(0)
    wire.decoder.frame(wire.ids.index(frames[0].id), frames[0].data, 0)
    wire.decoder.frame(wire.ids.index(frames[1].id), bytes(8), 0)
    assert np.isnan(wire.take().values[0, TURN]).all()
