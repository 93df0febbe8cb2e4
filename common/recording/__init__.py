"""Recordings on disk (MCAP): written beside a running loop, and read back even where they were cut off."""

from common.recording.chain import ChainCheck
from common.recording.chain_file import check_recording
from common.recording.reader import Entry, McapRecording, RecordingStream, read_recording
from common.recording.recorder import McapRecorder, RecorderCounters

__all__ = [
    "ChainCheck", "Entry", "McapRecorder", "McapRecording", "RecorderCounters", "RecordingStream",
    "check_recording", "read_recording",
]  # fmt: skip
