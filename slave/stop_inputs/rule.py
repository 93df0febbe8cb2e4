"""Which emergency stop inputs stop the robot now. Pure: every time is the slave's own clock, and is given.

Opening counts at once; closing counts once it has lasted. What nobody can know counts as open.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from common.clock import to_ns, to_s
from slave.stop_inputs.config import EstopConfig, StopInputConfig
from slave.stop_inputs.source import Level

PRESSED = "pressed, or its wire is broken"


class StopInput:
    """One input."""

    def __init__(self, config: StopInputConfig, settle_ns: int, silent_ns: int) -> None:
        self.config = config
        self._settle_ns = settle_ns
        self._silent_ns = silent_ns
        self._open_ns: int | None = None
        """When it was seen open last."""
        self._why = ""
        self._changed_ns: int | None = None

    def step(self, now_ns: int, level: Level, awake_ns: int) -> str:
        """Why it stops the robot now; empty where it does not.

        `awake_ns`: since when the slave has been reading without a pause of its own.
        """
        why = self._open(now_ns, level, awake_ns)
        if why:
            self._open_ns, self._why = now_ns, why
        elif self._open_ns is not None and abs(now_ns - self._open_ns) < self._settle_ns:
            return f"{self._why} (closed for less than {to_s(self._settle_ns):g} s)"
        return why

    def _open(self, now_ns: int, level: Level, awake_ns: int) -> str:
        changed, self._changed_ns = level.changed_ns != self._changed_ns, level.changed_ns
        if level.on is None:
            return level.why or "not known yet"
        # absolute: a reading from the future is of a clock that cannot be trusted
        silent_ns = min(abs(now_ns - level.read_ns), abs(now_ns - awake_ns))
        if silent_ns > self._silent_ns:
            return f"not heard for {to_s(silent_ns):.2f} s"
        pressed = level.why or (PRESSED if self.config.normally_closed else "pressed")
        if level.on is not self.config.on_at_rest:
            return pressed
        # what was open between two readings, and the change itself where it is the first that is seen
        return pressed if changed and level.changed_ns else ""


class StopInputs:
    """All inputs of one robot."""

    def __init__(self, config: EstopConfig) -> None:
        settle_ns, self._silent_ns = to_ns(config.settle_s), to_ns(config.silent_s)
        self._inputs = [StopInput(one, settle_ns, self._silent_ns) for one in config.inputs]
        self._stepped_ns: int | None = None
        self._late = False
        self._awake_ns = 0

    def step(self, now_ns: int, levels: Sequence[Level]) -> Mapping[str, str]:
        """Inputs that stop the robot, by name; where and why. Takes the newest level of each."""
        before_ns, self._stepped_ns = self._stepped_ns, now_ns
        late = before_ns is None or abs(now_ns - before_ns) > self._silent_ns // 2
        if late and not self._late:
            # this process itself stalled: the sources get time to read before one counts as silent
            self._awake_ns = now_ns
        self._late = late
        found = {}
        for one, level in zip(self._inputs, levels, strict=True):
            why = one.step(now_ns, level, self._awake_ns)
            if why:
                found[one.config.name] = f"{one.config.where}: {why}"
        return found
