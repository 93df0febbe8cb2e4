"""Recordings on disk (MCAP): written beside a running loop, and read back even where they were cut off."""

from common.recording.reader import Entry, Recording, RecordingStream, read_recording
from common.recording.recorder import Recorder, RecorderCounters

__all__ = ["Entry", "Recorder", "RecorderCounters", "Recording", "RecordingStream", "read_recording"]
