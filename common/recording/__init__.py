"""Recordings on disk (MCAP): written beside a running loop, and read back even where they were cut off."""

from common.recording.reader import Entry, McapRecording, RecordingStream, read_recording
from common.recording.recorder import McapRecorder, RecorderCounters

__all__ = ["Entry", "McapRecorder", "McapRecording", "RecorderCounters", "RecordingStream", "read_recording"]
