"""A copied world goes on exactly as the one it is of, and neither changes the other."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import mujoco
import numpy as np
import pytest

from common.wire.codec import encode
from deploy.harness.faults.begun import BegunScenes
from deploy.harness.faults.table import VIRTUAL
from deploy.harness.faults.virtual import try_on_virtual_clock
from deploy.sim.world.copy import copied
from deploy.sim.world.world import VirtualWorld, WorldSettings

ROWS = {fault.name: fault for fault in VIRTUAL}
MODEL = '<mujoco><worldbody><body><joint name="j"/><geom size="1"/></body></worldbody></mujoco>'


def sent(world: VirtualWorld) -> list[bytes]:
    return [*map(encode, world.commands), *map(encode, world.states)]


def test_two_copies_and_their_origin_go_on_alike_one_after_the_other() -> None:
    origin = VirtualWorld(WorldSettings())
    origin.engage()
    first, second = copied(origin), copied(origin)
    before = len(origin.states)
    for world in (first, origin, second):
        world.run(1.0)
        assert len(world.states) == before + 50
    assert sent(first) == sent(origin) == sent(second)


@pytest.mark.long
@pytest.mark.parametrize("name", ["link cut", "contact, fast", "second operator", "encoder silent"])
def test_a_trial_on_a_copied_scene_ends_as_one_on_a_scene_of_its_own(name: str) -> None:
    fault, scenes = ROWS[name], BegunScenes()
    alone, copied_once, copied_twice = (
        try_on_virtual_clock(fault, scenes=each) for each in (None, scenes, scenes)
    )
    assert repr(replace(alone, fault=fault)) == repr(copied_once) == repr(copied_twice)


@dataclass
class Holder:
    """Some objects that know of each other."""

    parts: list[Any]


def test_a_view_looks_into_the_copied_array() -> None:
    array = np.arange(12.0).reshape(3, 4)
    holder = copied(Holder([array[1:, ::2], array, array.T, array[:0]]))
    view, whole, turned, nothing = holder.parts
    whole[:] = 7.0
    assert (view == 7.0).all()
    assert (turned == 7.0).all()
    assert view.shape == (2, 2)
    assert nothing.shape == (0, 4)
    assert array[1, 1] == 5.0


def test_a_view_of_the_physics_looks_into_the_copied_physics() -> None:
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    holder = copied(Holder([data.qpos, data, model]))
    angle, twin, own = holder.parts
    angle[:] = 0.3
    assert twin.qpos[0] == 0.3
    assert data.qpos[0] == 0.0
    own.jnt_range[:] = 5.0
    assert not model.jnt_range.any()


class Counter:
    """Counts how often it was called."""

    def __init__(self) -> None:
        self.count = 0

    def add(self, number: int) -> None:
        self.count += number


def test_a_method_and_a_partial_call_are_bound_to_the_copy() -> None:
    counter = Counter()
    twin, method, call = copied(Holder([counter, counter.add, partial(counter.add, 2)])).parts
    method(1)
    call()
    assert (twin.count, counter.count) == (3, 0)


def test_what_a_deep_copy_would_share_is_refused() -> None:
    seen: list[int] = []
    with pytest.raises(TypeError, match=r"<lambda> refers to variables around it"):
        copied(Holder([lambda: seen.append(1)]))
    with pytest.raises(TypeError, match=r"list.append changes what would not be copied"):
        copied(Holder([seen.append]))
    with pytest.raises(TypeError, match=r"an array of \(4,\) looks into memory of a "):
        copied(Holder([np.frombuffer(bytearray(4), np.uint8)]))
