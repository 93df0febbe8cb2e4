"""From commands at 12.5 Hz to setpoints at the servo rate."""

from slave.track.tracker import Tracker, TrackTarget

__all__ = ["TrackTarget", "Tracker"]
