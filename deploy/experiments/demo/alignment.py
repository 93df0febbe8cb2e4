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
    """Of the master's file: the calibration of each node that the motion told of."""
    left: dict[str, str]
    """The other nodes, and why; the zero pose alone must do for them."""


def align(recording: Path, skeleton: Skeleton, folder: Path) -> RecordedAlignment:
    """Find how the sensors of a full-body recording sit, and write a file a node into `folder`.

    A segment that was not recorded goes by the one it hangs on, as in the replay: a flat, stiff hand.
    Where nothing can be said, as of a recording without a zero pose, every node is among the `left`.
    Raises RecordingError for a file that is none.
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
            left[name] = left.get(source, "nobody recorded it")
    return RecordedAlignment(overrides, left)


def _recorded(name: str, skeleton: Skeleton, known: set[str]) -> str:
    """The segment itself, or the nearest that it hangs on of which something is known."""
    while name not in known:
        parent = skeleton.segments[skeleton.segment_names.index(name)].parent
        if parent not in skeleton.segment_names:
            break
        name = parent
    return name
