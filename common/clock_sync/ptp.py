"""What ptp4l states of the clock that it steers, from the answers that `pmc` prints. Pure.

PTP measures the mean delay of the path and takes both ways as equally long. A way may be anything between 0
and twice the mean, so the offset is certain only within ± the mean path delay: on a wire some microseconds.
Stamps that are wrong can make that mean negative; by as much they are wrong at least.
"""

from __future__ import annotations

from dataclasses import dataclass

from common.clock import NS_PER_S

QUESTIONS = (
    "GET TIME_STATUS_NP", "GET CURRENT_DATA_SET", "GET PARENT_DATA_SET", "GET TIME_PROPERTIES_DATA_SET",
    "GET PORT_DATA_SET", "GET PORT_PROPERTIES_NP",
)  # fmt: skip
_FIRST_ACCURACY = 0x20
_ACCURACY_S = (
    25e-9, 100e-9, 250e-9, 1e-6, 2.5e-6, 10e-6, 25e-6, 100e-6, 250e-6, 1e-3, 2.5e-3, 10e-3, 25e-3, 0.1, 0.25,
    1.0, 10.0,
)  # fmt: skip
"""IEEE 1588-2008, table 6: clockAccuracy 20h to 30h."""
_STEERED = ("SLAVE",)
_GRANDMASTER = ("MASTER", "GRAND_MASTER")


@dataclass(frozen=True, slots=True)
class PtpState:
    """What ptp4l states."""

    offset_ns: int
    """The steered clock minus the grandmaster's."""
    error_ns: int
    scale: str
    """`utc` where the grandmaster's time is traceable, else its identity: it counts from anywhere."""
    utc_offset_s: int
    """TAI − UTC, for a clock that counts TAI; 0 where the grandmaster counts from anywhere."""
    leaps: bool
    hardware: bool
    """Whether it stamps in hardware, and so steers a PTP hardware clock rather than the system's."""


def read_state(printed: str) -> PtpState | str:
    """The state, or why nothing is stated. `printed`: answers to QUESTIONS, of a host with one port."""
    values: dict[str, str] = {}
    for line in printed.splitlines():
        words = line.split()
        if len(words) == 2:
            values.setdefault(words[0], words[1])
    try:
        return _state(values)
    except KeyError as error:
        return f"ptp4l does not tell {error.args[0]}"
    except (ValueError, OverflowError) as error:
        return f"ptp4l tells what is no number: {error}"


def _state(values: dict[str, str]) -> PtpState | str:
    port, present = values["portState"], values["gmPresent"] == "true"
    if port not in (_STEERED if present else _GRANDMASTER):
        return f"ptp4l's port is {port}"
    offset_ns = round(float(values["master_offset"])) if present else 0
    path_ns = abs(round(float(values["meanPathDelay"]))) if present else 0
    traceable = values["timeTraceable"] == values["ptpTimescale"] == values["currentUtcOffsetValid"] == "1"
    accuracy_s = _accuracy_s(int(values["gm.ClockAccuracy"], 16))
    by_utc = traceable and accuracy_s is not None
    return PtpState(
        offset_ns,
        abs(offset_ns) + path_ns + (round(accuracy_s * NS_PER_S) if by_utc and accuracy_s else 0),
        "utc" if by_utc else f"ptp {values['gmIdentity']}",
        int(values["currentUtcOffset"]) if values["ptpTimescale"] == "1" else 0,
        leaps="1" in (values["leap61"], values["leap59"]),
        hardware=values["timestamping"] == "HARDWARE",
    )


def _accuracy_s(code: int) -> float | None:
    known = 0 <= code - _FIRST_ACCURACY < len(_ACCURACY_S)
    return _ACCURACY_S[code - _FIRST_ACCURACY] if known else None
