"""One servo made ready: known, set, holding where it stands."""

from __future__ import annotations

from collections.abc import Sequence

from slave.encoders.counts import COUNTS_PER_TURN, RAD_PER_COUNT
from slave.servos.dynamixel import registers as x
from slave.servos.dynamixel.bus import Bus, ServoError
from slave.servos.dynamixel.lasting import HOW, Difference, differences, in_words
from slave.servos.dynamixel.latency import BEST_MS, advice, timer_ms
from slave.servos.dynamixel.settings import Settings

_DEG_PER_COUNT = RAD_PER_COUNT * 180.0 / 3.141592653589793


def inspect(bus: Bus, servo: Settings) -> None:
    """Whether a servo can be used as it is. Writes nothing that lasts.

    Raises ServoError, in words, for one that cannot; PortLostError.
    """
    different = know(bus, servo)
    if different:
        raise ServoError(f"{in_words(different)}; {HOW}")
    _check_place(servo, x.position_at_end(bus.read_bytes(servo.id, x.PLACE)))


def inspect_all(bus: Bus, servos: Sequence[Settings]) -> list[tuple[Settings, str]]:
    """The servos that cannot be used, and the reason. Raises PortLostError."""
    wrong = []
    for servo in servos:
        try:
            inspect(bus, servo)
        except ServoError as error:
            wrong.append((servo, str(error)))
    return wrong


def cannot_be_used(port: str, count: int, wrong: Sequence[tuple[Settings, str]]) -> str:
    """A refusal to start, with each of `count` servos that is `wrong`, and what to look at."""
    timer = timer_ms(port)
    slow = f"; {advice(port, timer)}" if timer is not None and timer > BEST_MS else ""
    lines = "\n".join(f"  {servo.joint} (id {servo.id}): {why}" for servo, why in wrong)
    return (
        f"{port}: {len(wrong)} of {count} servos cannot be used; "
        f"check power, cable, ids and baud rate{slow}:\n{lines}"
    )


def know(bus: Bus, servo: Settings) -> list[Difference]:
    """Whether it is a servo of this series and well, and what it keeps that must be replaced; only reads.

    Raises ServoError, in words, for one that cannot be used whatever is replaced; PortLostError.
    """
    model = bus.ping(servo.id)
    if not x.is_x_series(model):
        raise ServoError(f"it is model {model}, not of the X series (model numbers 1000 to 1299)")
    try:
        firmware = bus.read(servo.id, x.FIRMWARE)
    except ServoError:
        _let_answer(bus, servo)  # it answers a ping, so it may be set to answer nothing else
        firmware = bus.read(servo.id, x.FIRMWARE)
    if firmware < x.WATCHDOG_FIRMWARE:
        raise ServoError(
            f"its firmware {firmware} has no bus watchdog; update it to {x.WATCHDOG_FIRMWARE} or later"
        )
    error = x.hardware_words(bus.read(servo.id, x.HARDWARE_ERROR))
    if error:
        raise ServoError(f"{error}; its torque is off: fix the cause, then switch its power off and on")
    return differences(bus, servo)


def prepare(bus: Bus, servo: Settings) -> int:
    """Set a servo that was inspected, and switch its torque on with the goal where it stands: counts.

    A servo that holds already never lets go meanwhile. Its watchdog is left off: see `arm`.
    Raises ServoError, PortLostError.
    """
    _let_answer(bus, servo)
    for register, value in servo.passing:
        bus.write(servo.id, register, value)
    # a servo that its watchdog has stopped refuses goals until this. What it does until the goal is set,
    # a few ms later, is bounded by the velocity profile: the stop had lifted it
    if bus.read(servo.id, x.BUS_WATCHDOG):
        bus.write(servo.id, x.BUS_WATCHDOG, 0)
    holding = bool(bus.read(servo.id, x.TORQUE))
    stands = x.position_at_end(bus.read_bytes(servo.id, x.PLACE))
    if holding:
        _set_goal(bus, servo, stands)
    _check_place(servo, stands)
    if not holding:
        # with the torque on first some servos take the goal that was left from before
        _set_goal(bus, servo, stands)
        bus.write(servo.id, x.TORQUE, 1)
    return stands


def arm(bus: Bus, servo: Settings) -> None:
    """From here on the servo stops by itself when the bus falls silent. Raises ServoError."""
    bus.write(servo.id, x.BUS_WATCHDOG, servo.watchdog)


def _let_answer(bus: Bus, servo: Settings) -> None:
    # by the bus-wide way, which needs no answer: a servo may be set to give none but to a ping. It is lost
    # with the power
    bus.write_all(x.STATUS_RETURN, {servo.id: x.ANSWER_ALL})


def _set_goal(bus: Bus, servo: Settings, stands: int) -> None:
    bus.write(servo.id, x.GOAL_POSITION, min(max(stands, 0), COUNTS_PER_TURN - 1))


def _check_place(servo: Settings, stands: int) -> None:
    beyond = max(servo.lowest - stands, stands - servo.highest)
    if beyond > 0:
        raise ServoError(
            f"it stands {beyond * _DEG_PER_COUNT:.1f}° beyond its range; turn it back by hand, "
            "or correct its zero count"
        )
