"""Whether the operator's deadman and clutch can be held. Pure."""

from __future__ import annotations

from deploy.ops.doctor.judge.finding import Finding, fail, ok, warn
from deploy.ops.doctor.read.switches import PedalRead
from master.deadman.config import AlwaysHeld, CanButton, ConsoleHold, SwitchConfig

TRY = "press it meanwhile: `tandem inputs` shows each key that goes down and up"


def judge_switch(name: str, switch: SwitchConfig, pedal: PedalRead | None) -> Finding:
    """The deadman or the clutch; `pedal`: what was read of it, where it is one."""
    if isinstance(switch, AlwaysHeld):
        words = "always held: nothing stops the robot when the operator lets go"
        return warn(name, words, "give the operator a pedal: `tandem inputs`, [operator.deadman]")
    if isinstance(switch, CanButton):
        where = f"{switch.message}.{switch.signal} on {switch.bus}"
        return ok(name, f"{where}: shown by `tandem status` while the master runs")
    if isinstance(switch, ConsoleHold):
        return ok(name, f"held on a page of `tandem console`, heard at {switch.socket}")
    assert pedal is not None
    if pedal.down is None:
        return fail(name, pedal.why, "`tandem inputs` lists the devices and shows which key is pressed")
    state = "down now: release it before the master starts" if pedal.down else "up now"
    return ok(name, f"{switch.key} of {switch.device} ({pedal.path}) is {state}", TRY)
