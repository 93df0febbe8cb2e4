"""Whether a robot's emergency stop inputs work, and how a person tries each of them. Pure."""

from __future__ import annotations

from collections.abc import Sequence

from deploy.ops.doctor.judge.finding import Finding, fail, ok, warn
from deploy.ops.doctor.read.stops import StopRead
from slave.stop_inputs.gpio_lines import CONSUMER

_TRY = "try it: press it, then pull its plug; `tandem stops FILE` shows both, the slave stopped meanwhile"
_TRY_DRIVE = (
    "try it with the robot holding: press it, then pull its plug; `tandem status` names it both times"
)


def judge_stops(found: Sequence[StopRead], real_robot: bool, reset_key: bool) -> list[Finding]:
    """One finding an input, and what is missing. `real_robot`: it has servos that are not simulated."""
    rows = [_judge(one) for one in found]
    if real_robot and not found:
        words = "none: only the hardware emergency stop and the network stop this robot"
        rows.append(warn("stop inputs", words, "connect a button: [[estop.inputs]], docs/deployment.md"))
    if found and not reset_key:
        words = "no [guard] reset_key: after a press only a restart of the slave ends the e-stop"
        rows.append(warn("stop inputs", words, "set a key that is kept at the robot"))
    return rows


def _judge(one: StopRead) -> Finding:
    config = one.config
    check = f"stop input {config.name}"
    if config.source in ("drive", "sto"):
        return ok(check, f"{config.where}: told to the slave by the drive", _TRY_DRIVE)
    if one.at_rest is None:
        if CONSUMER in one.why:
            return ok(check, f"{config.where}: read by the slave that runs", _TRY_DRIVE)
        return fail(check, f"{config.where}: {one.why}", "mend it: the slave would begin in an e-stop")
    if not one.at_rest:
        words = f"{config.where}: open: pressed, or its wire is broken"
        return fail(check, words, "release or mend it: the slave would begin in an e-stop")
    if not config.normally_closed:
        words = f"{config.where}: not pressed; normally open: a broken wire is not noticed"
        return warn(check, words, "use a contact that is closed at rest, normally_closed = true")
    return ok(check, f"{config.where}: closed, not pressed", _TRY)
