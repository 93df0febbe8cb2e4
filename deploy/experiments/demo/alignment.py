"""A recorded person's sensors sit askew: the demo aligns them first, from the recording itself."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date
from pathlib import Path

from common.skeleton import Skeleton


@dataclass(frozen=True, slots=True)
class RecordedAlignment:
    """What the master needs to know of how a recording's sensors sit."""

    overrides: list[str]
    """Of the master's file: the calibration of each node whose alignment the motion shows."""
    left: dict[str, str]
    """The other nodes, and why: they are aligned by the zero pose alone."""


def align(recording: Path, skeleton: Skeleton, folder: Path) -> RecordedAlignment:
    """Find how the sensors of a full-body recording sit, and write a file a node into `folder`.

    A segment that was not recorded takes its parent's alignment, as in the replay: a flat, stiff hand.
    Where nothing is known, as of a recording without a zero pose, every node is among the `left`.
    Raises RecordingError for a file that is not a recording.
    """
    from master.calibrate.alignment import find_alignment
    from master.calibrate.alignment_files import of_profile, write_alignment
    from master.calibrate.hinge import PoorMotionError
    from master.calibrate.recording import load_recordings

    try:
        found = find_alignment(of_profile(load_recordings(recording), skeleton), skeleton)
    except PoorMotionError as error:
        return RecordedAlignment([], dict.fromkeys(skeleton.segment_names, str(error)))
    files = write_alignment(found, recording, folder, date.today())
    overrides, left = [], dict(found.refused)
    for name in skeleton.segment_names:
        source = _recorded(name, skeleton, {*files, *left})
        if source in files:
            overrides.append(f'nodes.{name}.calibration="{files[source].resolve()}"')
        elif name not in left:
            left[name] = left.get(source, "it was not recorded")
    return RecordedAlignment(overrides, left)


def _recorded(name: str, skeleton: Skeleton, known: set[str]) -> str:
    """The segment itself, or the nearest parent that was recorded."""
    while name not in known:
        parent = skeleton.segments[skeleton.segment_names.index(name)].parent
        if parent not in skeleton.segment_names:
            break
        name = parent
    return name
