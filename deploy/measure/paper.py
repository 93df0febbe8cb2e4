"""The figures printed in the source paper (A: Zuo et al., telerobotic nursing), to stand beside ours."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PaperRow:
    """One row of Table 1: a joint over its fast-moving period, at steps of 80 ms."""

    change_deg: float
    """Mean change of the reference angle per step."""
    error_deg: float
    """Mean error against the reference, after the paper shifted its solved angles by one step."""
    ratio: float
    """Error over change."""


TABLE_1 = {
    "shoulder_pitch": PaperRow(4.653, 0.594, 0.127),
    "shoulder_roll": PaperRow(4.02, 0.451, 0.112),
    "shoulder_yaw": PaperRow(4.942, 0.722, 0.146),
    "elbow_pitch": PaperRow(2.145, 0.547, 0.255),
    "elbow_roll": PaperRow(3.581, 0.695, 0.194),
}
"""Keyed by joint without its side: the paper measured one arm."""

ETA_PERCENT = 1.73
"""Eq. 25."""

STEP_TICKS = 16
"""Capture ticks in one step of 80 ms."""
