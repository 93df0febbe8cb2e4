"""Iron and magnets near the operator: what the earth's magnetic field becomes at each node."""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from common.config.section import Section
from common.quaternion import Array, heading_turn, rotate
from common.wire.messages import Mask

Vector = Annotated[list[float], Field(min_length=3, max_length=3)]

_UT_M3_PER_A_M2 = 0.1
"""μ0 / 4π, in µT m³ / (A m²)."""
_NEAREST_M = 0.1
"""A dipole's field is not followed nearer than this: no magnet is a point."""


class DipoleConfig(Section):
    """`[[disturbance.dipole]]`: a magnetised thing that stands in the room, such as a bed's rail."""

    position_m: Vector
    """World, the origin on the ground below the operator's waist (x ahead, y left, z up)."""
    moment_a_m2: Vector
    """World, A m²; 20 gives 32 µT half a metre away along it, and 4 µT a metre away."""


class LocalConfig(Section):
    """`[[disturbance.local]]`: a field at some nodes for some time, such as from a tool in the hand."""

    nodes: list[str] | Literal["all"] = "all"
    """Segments."""
    from_s: float = Field(default=0.0, ge=0.0)
    until_s: float = Field(default=math.inf, ge=0.0, allow_inf_nan=True)
    ramp_s: float = Field(default=0.0, ge=0.0)
    """From nothing to the whole, and back, s: rises from `from_s` on, falls from `until_s` on."""
    field_ut: Vector = Field(default=[0.0, 0.0, 0.0])
    """Added, world, µT."""
    turn_deg: float = Field(default=0.0, ge=-180.0, le=180.0)
    """The earth's field turned by this about the vertical, degrees from east towards north. Strength and
    dip stay as they were, so that nothing in the node's own reading gives it away."""


class DisturbanceConfig(Section):
    """`[disturbance]`: none by default."""

    dipole: list[DipoleConfig] = Field(default=[])
    local: list[LocalConfig] = Field(default=[])

    def unknown_nodes(self, known: list[str]) -> list[str]:
        """Nodes that a local field names but the suit does not have."""
        named = [name for local in self.local if local.nodes != "all" for name in local.nodes]
        return [name for name in named if name not in known]


class Disturbance:
    """The magnetic field at N nodes, by place and time."""

    def __init__(self, config: DisturbanceConfig, segment_names: tuple[str, ...], earth_ut: Array) -> None:
        """`earth_ut` (3,) in the world is what there is without any disturbance."""
        self._earth_ut = earth_ut
        self._dipoles = [(np.array(d.position_m), np.array(d.moment_a_m2)) for d in config.dipole]
        self._locals = [(local, _named(local, segment_names)) for local in config.local]

    def field_ut(self, t_s: float, position_m: Array) -> Array:
        """The field (N, 3) at places (N, 3), world, `t_s` after the motion's beginning."""
        field: Array = np.tile(self._earth_ut, (len(position_m), 1))
        for local, nodes in self._locals:
            share = _share(local, t_s)
            turned = rotate(heading_turn(share * math.radians(local.turn_deg)), self._earth_ut)
            field[nodes] += turned - self._earth_ut + share * np.array(local.field_ut)
        for place_m, moment in self._dipoles:
            field += dipole_ut(position_m - place_m, moment)
        return field


def dipole_ut(from_dipole_m: Array, moment_a_m2: Array) -> Array:
    """A dipole's field, µT (N, 3): μ0/4π (3 r̂ (m·r̂) − m) / r³, at places (N, 3) seen from it."""
    r = np.linalg.norm(from_dipole_m, axis=-1, keepdims=True)
    towards = from_dipole_m / np.maximum(r, 1e-9)
    shape = 3.0 * towards * (towards @ moment_a_m2)[:, None] - moment_a_m2
    out: Array = _UT_M3_PER_A_M2 * shape / np.maximum(r, _NEAREST_M) ** 3
    return out


def _named(local: LocalConfig, segment_names: tuple[str, ...]) -> Mask:
    return np.array([local.nodes == "all" or name in local.nodes for name in segment_names])


def _share(local: LocalConfig, t_s: float) -> float:
    """How much of a local field there is, 0 to 1."""
    if local.ramp_s == 0.0:
        return float(local.from_s <= t_s < local.until_s)
    rising = (t_s - local.from_s) / local.ramp_s
    falling = 1.0 - (t_s - local.until_s) / local.ramp_s
    return min(max(min(rising, falling), 0.0), 1.0)
