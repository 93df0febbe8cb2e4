"""One X series servo: its control table, what it refuses, when it stops by itself, how it moves."""

from __future__ import annotations

import math

from slave.encoders.counts import COUNTS_PER_TURN, RAD_PER_COUNT
from slave.servos.dynamixel import registers as x
from slave.servos.dynamixel.registers import Register

_PRESENT_CURRENT = Register(126, 2, signed=True)
OK, LENGTH, LIMIT, ACCESS = 0, 5, 6, 7
ALERT = 0x80
_TABLE_BYTES = 147
_LASTING_BYTES = 64
"""The table's beginning is kept without power, and locked while the torque is on."""
_GOALS = range(100, 120)
_PROFILES = (x.PROFILE_ACCELERATION.address, x.PROFILE_VELOCITY.address)
_OMEGA_RAD_S = 2.0 * math.pi * 8.0
_WATCHDOG_UNIT_NS = 20_000_000


class SimulatedServo:
    """A motor that follows its goal like a critically damped 8 Hz system, no faster than its profile."""

    def __init__(self, servo: int, position: float = 2048.0, model: int = 1020, firmware: int = 45) -> None:
        """At rest at `position`, counts, as it leaves its box: torque off, answering after 500 µs."""
        self.id = servo
        self.position = position
        """Counts, finer than the encoder shows."""
        self.velocity = 0.0
        """Counts/s."""
        self.load_nm = 0.0
        """Torque that it holds, in the direction of rising counts."""
        self.constant_nm_a = 1.78
        self.silent = False
        """It takes in nothing and gives no answer."""
        self._table = bytearray(_TABLE_BYTES)
        self._heard_ns = 0
        self._stopped_at = position
        self._moved_ns: int | None = None
        for register, value in (
            (x.MODEL, model), (x.FIRMWARE, firmware), (x.RETURN_DELAY, 250), (x.OPERATING_MODE, 3),
            (x.MAX_POSITION, COUNTS_PER_TURN - 1), (x.STATUS_RETURN, 2),
        ):  # fmt: skip
            self.put(register, value)
        self.power_cycle()

    # what only the table's owner may do

    def get(self, register: Register) -> int:
        """A register's value."""
        return register.decode(bytes(self._table[register.address : register.address + register.size]))

    def put(self, register: Register, value: int) -> None:
        """Set a register, whatever the rules for the bus are."""
        self._table[register.address : register.address + register.size] = register.encode(value)

    def power_cycle(self) -> None:
        """What is lost with the power."""
        for address in range(_LASTING_BYTES, _TABLE_BYTES):
            self._table[address] = 0
        self.put(x.STATUS_RETURN, 2)
        self.put(x.GOAL_POSITION, round(self.position))
        self.velocity = 0.0

    def fail(self, error: int) -> None:
        """A hardware error: it lets go."""
        self.put(x.HARDWARE_ERROR, error)
        self.put(x.TORQUE, 0)

    @property
    def alert(self) -> int:
        """The error byte's bit that tells of a hardware error."""
        return ALERT if self.get(x.HARDWARE_ERROR) else 0

    # the bus

    def read(self, address: int, size: int) -> tuple[int, bytes]:
        """Error code and bytes."""
        if address + size > _TABLE_BYTES:
            return ACCESS, b""
        self.put(x.PRESENT_POSITION, round(self.position) + self.get(x.HOMING_OFFSET))
        self.put(_PRESENT_CURRENT, self._current() if self.get(x.TORQUE) else 0)
        return OK, bytes(self._table[address : address + size])

    def _current(self) -> int:
        """As the manual of its model has it: in 2.69 mA, in 1 mA, or no current but a share of its most."""
        model, amperes = self.get(x.MODEL), self.load_nm / self.constant_nm_a
        if model in (1060, 1070, 1080, 1090):
            return max(-1000, min(1000, round(self.load_nm / 1.4 * 1000)))
        limit, unit_a = (1750, 1e-3) if model >= 1190 else (1193, 2.69e-3)
        return max(-limit, min(limit, round(amperes / unit_a)))

    def write(self, address: int, data: bytes) -> int:
        """Error code."""
        if not data or address + len(data) > _TABLE_BYTES:
            return LENGTH
        if address < _LASTING_BYTES and self.get(x.TORQUE):
            return ACCESS
        is_goal = address in _GOALS and address not in _PROFILES
        if is_goal and self.get(x.BUS_WATCHDOG) == x.WATCHDOG_TRIPPED:
            return LIMIT
        if address == x.GOAL_POSITION.address:
            goal = x.GOAL_POSITION.decode(data)
            if not self.get(x.MIN_POSITION) <= goal <= self.get(x.MAX_POSITION):
                return LIMIT
        if address == x.TORQUE.address and data[0] and self.get(x.HARDWARE_ERROR):
            return ACCESS
        self._table[address : address + len(data)] = data
        return OK

    def heard(self, now_ns: int) -> None:
        """Some packet came over the bus."""
        self._heard_ns = now_ns

    # time

    def advance(self, now_ns: int) -> None:
        """Move on to `now_ns`; stop where the bus has been silent for too long by then."""
        watchdog = self.get(x.BUS_WATCHDOG)
        if watchdog > 0 and self.get(x.TORQUE):
            trips_ns = self._heard_ns + watchdog * _WATCHDOG_UNIT_NS
            if now_ns > trips_ns:
                self._move(trips_ns)
                self._trip()
        self._move(now_ns)

    def _trip(self) -> None:
        self.put(x.BUS_WATCHDOG, x.WATCHDOG_TRIPPED)
        self.put(x.PROFILE_VELOCITY, 0)
        self.put(x.PROFILE_ACCELERATION, 0)
        # the goal from before stays, and counts again once the watchdog is cleared
        self._stopped_at = self.position
        self.velocity = 0.0

    def _move(self, now_ns: int) -> None:
        before_ns, self._moved_ns = self._moved_ns, now_ns
        if before_ns is None or now_ns <= before_ns or not self.get(x.TORQUE):
            return
        dt_s = (now_ns - before_ns) / 1e9
        # the closed form of x'' = ω² (goal - x) - 2 ω x'
        goal = float(self.get(x.GOAL_POSITION))
        if self.get(x.BUS_WATCHDOG) == x.WATCHDOG_TRIPPED:
            goal = self._stopped_at
        error = self.position - goal
        slope = self.velocity + _OMEGA_RAD_S * error
        decay = math.exp(-_OMEGA_RAD_S * dt_s)
        way = goal + (error + slope * dt_s) * decay - self.position
        fastest = self.get(x.PROFILE_VELOCITY) * x.RAD_S_PER_UNIT / RAD_PER_COUNT
        most = fastest * dt_s if fastest else math.inf
        self.position += min(max(way, -most), most)
        velocity = (slope - _OMEGA_RAD_S * (error + slope * dt_s)) * decay
        self.velocity = min(max(velocity, -fastest), fastest) if fastest else velocity
