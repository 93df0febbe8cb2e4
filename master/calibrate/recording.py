"""Recordings as the calibration takes them: the raw readings of one node or of a whole suit, from a file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from common.errors import RecordingError as RecordingError
from common.recording.formats.registry import read_nodes
from common.recording.node import NodeRecording as NodeRecording


def load_recordings(path: Path) -> dict[str, NodeRecording]:
    """The nodes of a file of any known format (docs/recordings.md), by name. Raises RecordingError.

    What was assumed about the file (units, columns, frames) is among each node's notes.
    """
    read = read_nodes([path])
    return {
        name: replace(node, notes=tuple(dict.fromkeys((*read.notes, *node.notes))))
        for name, node in read.nodes.items()
    }
