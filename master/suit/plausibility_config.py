"""`[capture.plausibility]` of the master's file: when a node's readings are not believed."""

from __future__ import annotations

from pydantic import Field

from common.config.section import Section


class PlausibilityConfig(Section):
    """`[capture.plausibility]`: when a node that answers is not believed. Times in seconds."""

    noise_free: bool = False
    """True: the nodes' readings have no noise (made without any, as no real sensor does), so that exact
    repeats prove nothing. Then only clipping and contradictions of gravity are seen."""
    repeats_s: float = Field(default=0.1, ge=0.05, le=2.0)
    """An accelerometer or a gyro that repeats all three axes for so long is frozen. The recordings: 0.01."""
    axis_s: float = Field(default=0.16, ge=0.05, le=5.0)
    """One axis that stands for so long while the sensor's others move is stuck. The recordings: 0.035."""
    still_axis_s: float = Field(default=2.0, ge=0.1, le=30.0)
    """Where the others are quiet too, an axis is stuck when it stands longer than by chance once a year, by
    its own noise: 0.16 s at 1 count, 0.2 at 0.9, 0.23 at 0.75, 0.35 at 0.6, 0.55 at 0.5. An axis so quiet
    that this would take longer than `still_axis_s` is judged only while its node moves."""
    magnetometer_s: float = Field(default=1.0, ge=0.1, le=60.0)
    """A magnetometer (most are slower than the nodes' rate) that stands for so long while its node turns by a
    radian is stuck: it is not used, and the node goes on without it. In the recordings: 0.06."""
    gravity_share: float = Field(default=0.25, gt=0.0, lt=1.0)
    """By how much of g a still node may read another specific force. As delivered: 0.12; a range set wrongly
    is 1 or 0.5. In the recordings: 0.07."""
    contradiction_deg: float = Field(default=35.0, gt=5.0, le=180.0)
    """How far gravity of the last 0.8 s may be from that of the last 3 s, both carried on by the gyro. In the
    recordings: 14 on arms, trunk and head, 23 on a running person's foot. 180: not judged."""
    clear_s: float = Field(default=2.0, ge=0.0, le=60.0)
    """A node is believed again when nothing has been wrong for so long. Its filter then starts anew."""
