"""The doctor on what the operator holds."""

from __future__ import annotations

from common.inputs.listing import ListedDevice
from deploy.ops.doctor.judge.finding import Health
from deploy.ops.doctor.judge.switches import judge_switch
from deploy.ops.doctor.read.switches import PedalRead, read_pedal
from master.deadman.config import AlwaysHeld, CanButton, Pedal
from tests.common.inputs.pseudo import PEDAL, Socket, socket

__all__ = ["socket"]
SWITCH = Pedal(source="pedal", device="FootSwitch", key="KEY_B")
DEVICES = [ListedDevice("/dev/input/event7", "FootSwitch", "usb-1", frozenset({PEDAL}), True, False)]


def test_a_pedal_is_read_and_not_grabbed(socket: Socket) -> None:
    pedal = socket.plug_in()
    assert read_pedal(SWITCH, lambda: DEVICES) == PedalRead("/dev/input/event7", "", down=False)
    assert not pedal.grabbed
    socket.plug_in().pressed.add(PEDAL)
    assert read_pedal(SWITCH, lambda: DEVICES).down is True


def test_why_a_pedal_cannot_be_read(socket: Socket) -> None:
    assert "no input device is named" in read_pedal(SWITCH, list).why
    assert "No such file" in read_pedal(SWITCH, lambda: DEVICES).why
    unknown = SWITCH.model_copy(update={"key": "KEY_NOWHERE"})
    assert "knows no key" in read_pedal(unknown, lambda: DEVICES).why


def test_each_is_judged() -> None:
    up = judge_switch("deadman", SWITCH, PedalRead("/dev/input/event7", "", down=False))
    assert (up.health, "up now" in up.found) == (Health.OK, True)
    down = judge_switch("deadman", SWITCH, PedalRead("/dev/input/event7", "", down=True))
    assert "release it before" in down.found
    gone = judge_switch("clutch", SWITCH, PedalRead("", "no input device is named 'FootSwitch'"))
    assert (gone.check, gone.health) == ("clutch", Health.FAIL)
    assert judge_switch("deadman", AlwaysHeld(source="always_held"), None).health is Health.WARN
    button = judge_switch("deadman", CanButton(source="can", bus="suit", signal="DEADMAN"), None)
    assert (button.health, "BUTTONS.DEADMAN on suit" in button.found) == (Health.OK, True)
