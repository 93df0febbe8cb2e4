"""From scene to eye: when a picture was on a page's screen, less the time that it shows itself. Pure.

Nothing of it is taken from the frame's stamps: the time is read out of the picture's own pixels
(`common/picture_code`), so it also judges the stamps.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite

import numpy as np

from common.clock import NS_PER_MS, NS_PER_S
from common.clock_sync import Offset
from common.picture_code import resolve_ns
from deploy.console.model.values import ms

KEPT = 60
"""Figures of one camera."""
_FAR_NS = 10 * NS_PER_S
"""No picture is on a screen so long before or after its report."""
_OLD_NS = 10 * NS_PER_S
"""An older figure is not shown."""
_COUNTS = 1 << 32


@dataclass(frozen=True, slots=True)
class ShownPicture:
    """What a page reports of one picture."""

    camera: str
    number: int
    counts: tuple[int, ...]
    """The codes that were read in it."""
    at_ns: int
    """When it was on the screen at the latest, this host's clock."""
    bound_ns: int
    """Half-width: of the page's clock, and one refresh of its screen."""


def read_shown(body: Mapping[str, object], now_ns: int) -> ShownPicture | None:
    """A page's report; None where it is none."""
    camera, number, counts = body.get("camera"), body.get("number"), body.get("counts")
    if not isinstance(camera, str) or type(number) is not int or not isinstance(counts, list):
        return None
    if not 0 < len(counts) <= 4 or not all(type(each) is int and 0 <= each < _COUNTS for each in counts):
        return None
    at_ms, bound_ms = body.get("at_ms"), body.get("bound_ms")
    if not isinstance(at_ms, int | float) or not isinstance(bound_ms, int | float):
        return None
    if not (isfinite(at_ms) and isfinite(bound_ms)) or bound_ms < 0 or abs(at_ms) > 1e15 or bound_ms > 1e4:
        return None
    at_ns = round(at_ms * NS_PER_MS)
    if abs(at_ns - now_ns) > _FAR_NS:
        return None
    return ShownPicture(camera, number, tuple(counts), at_ns, round(bound_ms * NS_PER_MS))


@dataclass(slots=True)
class _Camera:
    figures_ns: deque[int]
    bound_ns: int = 0
    stamp_off_ns: int | None = None
    told_ns: int = 0


class GlassWatch:
    """What one page reports, by camera."""

    def __init__(self) -> None:
        self._cameras: dict[str, _Camera] = {}

    def add(self, shown: ShownPicture, offset: Offset | None, captured_ns: int | None) -> int | None:
        """From scene to eye, ns; None while the robot's clock is not known.

        `offset`: this host's clock minus the robot's. `captured_ns`: the picture's stamp, if known.
        """
        if offset is None or not offset.trusted:
            return None
        near_ns = offset.local_ns(shown.at_ns)
        scene_ns = max(resolve_ns(count, near_ns) for count in shown.counts)
        late_ns = shown.at_ns - offset.remote_ns(scene_ns)
        camera = self._cameras.setdefault(shown.camera, _Camera(deque(maxlen=KEPT)))
        camera.figures_ns.append(late_ns)
        camera.bound_ns = shown.bound_ns + offset.bound_ns
        camera.stamp_off_ns = None if captured_ns is None else scene_ns - captured_ns
        camera.told_ns = shown.at_ns
        return late_ns

    def shown(self, now_ns: int) -> dict[str, dict[str, object]]:
        """By camera: the newest figure, its bound, percentiles, and by how much the stamp is off."""
        return {
            name: {
                "ms": ms(camera.figures_ns[-1], 1),
                "bound_ms": ms(camera.bound_ns, 1),
                "p50_ms": ms(int(np.percentile(camera.figures_ns, 50)), 1),
                "p95_ms": ms(int(np.percentile(camera.figures_ns, 95)), 1),
                "count": len(camera.figures_ns),
                "stamp_off_ms": ms(camera.stamp_off_ns, 1),
            }
            for name, camera in self._cameras.items()
            if now_ns - camera.told_ns <= _OLD_NS
        }

    def clear(self) -> None:
        """Another robot is shown."""
        self._cameras.clear()
