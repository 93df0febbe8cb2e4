"""`calibrate imu --method six-position`: six attitudes and three turns of a recording to a node's maps."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date

import numpy as np

from common.config.sensor_calibration import Made
from common.quaternion import Array
from master.calibrate import inertial_evidence as compare
from master.calibrate.carried import carried
from master.calibrate.evidence import CrossCheck, agrees, at_most, not_judged, refuse_contradictions, unjudged
from master.calibrate.inertial_readings import STANDARD_GRAVITY_M_S2, InertialReadings, made, sound_readings
from master.calibrate.node_file import Part
from master.calibrate.recording import NodeRecording, RecordingError
from master.calibrate.six_position import SixFaces, ThreeTurns, check_tilt, fit_faces, fit_turns, turn_scale
from master.calibrate.still import (
    Intervals,
    interval_means,
    still_intervals,
    stillest_level,
    variation,
)

_CALM = 6.0
"""Times the stillest, up to which a node rests."""
_LEAST_CALM_M_S2 = 0.05
_COMPARED = "gyroscope's axes against gravity's turns"


@dataclass(frozen=True, slots=True)
class SixPositionOptions:
    """What a person may choose."""

    gravity_m_s2: float = STANDARD_GRAVITY_M_S2
    turn_rad: float = 2.0 * np.pi
    """Of each of the three turns."""
    shortest_still_s: float = 1.5


@dataclass(frozen=True, slots=True)
class SixPositionCalibration:
    """What was found, and how good it is."""

    name: str
    still: Intervals
    accelerometer: SixFaces
    gyroscope: ThreeTurns
    notes: tuple[str, ...]
    evidence: tuple[CrossCheck, ...]

    def parts(self, day: date, recording: str) -> dict[Part, tuple[Array, Made]]:
        """As `write_calibration` takes them."""
        a, g = self.accelerometer, self.gyroscope
        return {
            "accelerometer": (a.affine, made(day, recording, "m/s²", a.before_m_s2, a.after_m_s2, a.sigma)),
            "gyroscope": (g.affine, made(day, recording, "rad", g.before_rad, g.after_rad, g.sigma)),
        }


def calibrate_six_position(
    recording: NodeRecording, options: SixPositionOptions = SixPositionOptions()
) -> SixPositionCalibration:
    """Find the maps of both sensors. Raises RecordingError when the recording does not determine them."""
    sound = sound_readings(recording, options.gravity_m_s2)
    recording, rates = sound.recording, sound.rates
    evidence = [*sound.evidence]
    still = _rests(sound, options)
    readings = interval_means(recording.acc_m_s2, still)
    faces = fit_faces(readings, options.gravity_m_s2, counts=recording.counts)
    evidence += refuse_contradictions([check_tilt(faces.tilt_rad)])
    force = readings @ faces.affine[:, :3].T + faces.affine[:, 3]
    scale = turn_scale(rates, still, force, recording.rate_hz, options.turn_rad) if recording.counts else 1.0
    turns = fit_turns(scale * rates, still, force, recording.rate_hz, options.turn_rad)
    evidence += refuse_contradictions([_axes(recording, scale * rates, faces, turns)])
    to_reading = np.array([scale, scale, scale, 1.0])
    turns = ThreeTurns(turns.affine * to_reading, turns.sigma * to_reading, turns.before_rad, turns.after_rad)
    return SixPositionCalibration(
        recording.name,
        still,
        faces,
        turns,
        (*recording.notes, *unjudged(evidence)),
        tuple(evidence),
    )


def _rests(sound: InertialReadings, options: SixPositionOptions) -> Intervals:
    """Rests (K, 2) by both sensors."""
    recording, turning = sound.recording, sound.level / (_CALM * sound.rest)
    moved = variation(sound.force_bridged(), recording.rate_hz)
    least = 2.0 if recording.counts else _LEAST_CALM_M_S2
    shaking = moved / (_CALM * stillest_level(moved, floor=least / _CALM))
    still = still_intervals(
        np.maximum(turning, shaking), 1.0, recording.rate_hz, max(options.shortest_still_s, 1.0)
    )
    if len(still) < 6:
        raise RecordingError(
            f"{len(still)} rests of {options.shortest_still_s:g} s or more were found, at least 6 are "
            "needed; lay the node on each of its six faces, then turn it about each axis from rest to rest"
        )
    return still


def _axes(recording: NodeRecording, rates: Array, faces: SixFaces, turns: ThreeTurns) -> CrossCheck:
    """The gyroscope's signs, which the turns alone do not tell, by how gravity moved meanwhile."""
    force = recording.acc_m_s2 @ faces.affine[:, :3].T + faces.affine[:, 3]
    found = carried(force, rates @ turns.affine[:, :3].T + turns.affine[:, 3], recording.rate_hz)
    if found is not None and found.confused:
        return at_most(
            _COMPARED,
            1.0 - found.explained / found.left_over,
            0.0,
            advice=f"the gyroscope does not explain how gravity turns: {compare.whose(found.axes)}. Correct "
            "that in the driver, and record again",
        )
    if found is None or not found.known or not found.signs_known:
        return not_judged(
            _COMPARED,
            "the node was not recorded while each of its axes turned gravity; record the way from face to "
            "face, about all axes",
        )
    return agrees(_COMPARED, 0.0, 0.0)
