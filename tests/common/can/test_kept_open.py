"""When a bus whose controller left the bus counts as up again."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable

import can
import pytest

from common.can.bus import CanBus
from common.can.config import BusConfig
from common.can.controller import Controller
from common.errors import BusError
from tests.common.can.test_bus import ScriptedBus, run


class Story:
    """A bus whose controller stands as `state` says."""

    def __init__(self, state: Controller | None) -> None:
        self.state = state
        self.opened: list[ScriptedBus] = []
        self.changes: list[bool] = []
        self.asked = 0
        self.stirred = asyncio.Event()
        config = BusConfig(name="left", interface="socketcan", channel="can7")
        self.bus = CanBus(config, self._on_frame, self._on_change, self._open, state_of=self._state_of)

    def _open(self, config: BusConfig) -> can.BusABC:
        self.opened.append(ScriptedBus())
        return self.opened[-1]

    def _state_of(self, config: BusConfig, bus: can.BusABC) -> Controller | None:
        self.asked += 1
        return self.state

    def _on_frame(self, *_: object) -> None:
        self.stirred.set()

    def _on_change(self, name: str, up: bool) -> None:
        self.changes.append(up)
        self.stirred.set()

    def hear(self, frame_id: int, error: bool, data: bytes = bytes(8)) -> None:
        message = can.Message(arbitration_id=frame_id, is_extended_id=False, is_error_frame=error, data=data)
        self.opened[-1].heard.append(message)

    async def until(self, condition: Callable[[], bool]) -> None:
        while not condition():
            self.stirred.clear()
            with contextlib.suppress(TimeoutError):  # not every step stirs
                await asyncio.wait_for(self.stirred.wait(), 0.01)


def test_a_bus_is_not_up_again_while_its_controller_is_off(caplog: pytest.LogCaptureFixture) -> None:
    async def test() -> None:
        story = Story(Controller.ERROR_ACTIVE)
        story.bus.open()
        story.hear(0x40, error=True)
        story.state = Controller.BUS_OFF
        await story.until(lambda: story.asked >= 3)
        assert not story.bus.up
        assert story.bus.state is Controller.BUS_OFF
        assert story.changes == [True, False]
        assert "up again" not in caplog.text
        assert story.bus.last_error.startswith("bus-off: the controller has left the bus")
        story.state = Controller.ERROR_ACTIVE
        await story.until(lambda: story.bus.up)
        assert story.changes == [True, False, True]
        await story.bus.close()

    run(test())


@pytest.mark.parametrize("error", [True, False])
def test_where_nothing_tells_the_state_a_frame_or_a_restart_shows_it(error: bool) -> None:
    async def test() -> None:
        story = Story(None)
        story.bus.open()
        story.hear(0x40, error=True)
        await story.until(lambda: len(story.opened) == 2 and story.bus._bus is not None)
        assert not story.bus.up
        assert story.changes == [True, False]
        story.hear(0x100 if error else 0x181, error)
        await story.until(lambda: story.bus.up)
        assert story.changes == [True, False, True]
        await story.bus.close()

    run(test())


def test_a_controller_that_is_off_at_the_start_is_told() -> None:
    async def test() -> None:
        with pytest.raises(BusError, match="bus left: bus-off"):
            Story(Controller.BUS_OFF).bus.open()

    run(test())


def test_error_passive_is_in_the_figures() -> None:
    async def test() -> None:
        story = Story(Controller.ERROR_ACTIVE)
        story.bus.open()
        story.hear(0x04, error=True, data=bytes([0, 0x20, 0, 0, 0, 0, 128, 0]))
        await story.until(lambda: story.bus.counters.error_frames == 1)
        assert story.bus.metrics().state == "error-passive"
        assert story.bus.up
        await story.bus.close()

    run(test())
