"""How a camera sees the robot that carries it: what a ghost over its picture is drawn by."""

from __future__ import annotations

from dataclasses import dataclass

from common.metrics.tree import Metrics


@dataclass(frozen=True, slots=True)
class Lens(Metrics):
    """A pinhole with radial distortion (Brown 1971), in shares of the picture, whatever its size in pixels.

    A point (x, y, z) m in the camera's axes, x right, y down, z ahead, is seen at
    `centre` + `focal` · (x, y) / z · (1 + k1 r² + k2 r⁴), r² = (x² + y²) / z².
    """

    link: str
    """The body of the robot that carries it; empty: its base."""
    position_m: tuple[float, float, float]
    """In that body's frame."""
    q_link_from_camera: tuple[float, float, float, float]
    focal: tuple[float, float]
    """Focal lengths over the picture's width and height."""
    centre: tuple[float, float]
    """Where the optical axis meets the picture, from its left and from its top."""
    radial: tuple[float, float] = (0.0, 0.0)
    """k1, k2."""
