"""Three angles of an axis from gravity and the Earth's field (paper D, section 1), by vectors alone.

The instrument's frame: z is the axis (the paper's pull F), x and y across it, right-handed. World:
east-north-up. `up` is the specific force that an accelerometer at rest measures, the paper's -G; `field` the
magnetometer's H. Only their directions count. Angles rad; azimuths grow clockwise as a compass does,
tool-faces as the instrument turns right-handed about its axis. NaN where an angle has no meaning.

The paper's ψ, θ, φ (its Eqs. 3 to 5) are other angles: turning about the axis alone makes them swing. Its
Eq. 20 is wrong in print; `azimuth_rad` is built from east and north instead.
"""

from __future__ import annotations

import numpy as np

from common.quaternion import Array, cross, from_axis_angle, heading_turn, multiply

_SMALLEST_SINE = 1e-9
"""Between a direction and the axis that it is to tell a turn about: below it, rounding alone is left."""


def inclination_rad(up: Array) -> Array:
    """The axis' angle from the vertical, 0 (upwards) to π; (..., 3) in, (...) out. Eq. 10.

    Not by arccos, which loses half of the digits near the vertical.
    """
    out: Array = np.arctan2(_across(up), np.where(_across(up) + np.abs(up[..., 2]) > 0.0, up[..., 2], np.nan))
    return out


def azimuth_rad(up: Array, field: Array) -> Array:
    """Magnetic azimuth of the axis's horizontal projection, 0 to 2π. Shapes (..., 3) in, (...) out.

    East = down × field, north = east × down; atan2(axis · east, axis · north). NaN where the axis or the
    field is vertical.
    """
    up = _unit(up)
    east = _unit(cross(-up, _unit(field)), _SMALLEST_SINE)
    north = cross(east, -up)
    return _turn(east[..., 2], north[..., 2])


def gravity_tool_face_rad(up: Array) -> Array:
    """Turn about the axis from gravity, atan2(G_x, G_y), 0 to 2π (Eq. 21): 0 where y is at the low side.

    Shapes (..., 3) in, (...) out. NaN where the axis is vertical.
    """
    up = _unit(up)
    return _turn(-up[..., 0], -up[..., 1])


def magnetic_tool_face_rad(field: Array) -> Array:
    """Turn about the axis from the field, atan2(H_x, H_y), 0 to 2π (Eq. 22): 0 where y is at its side.

    Shapes (..., 3) in, (...) out. NaN where the axis lies along the field.
    """
    field = _unit(field)
    return _turn(field[..., 0], field[..., 1])


def true_azimuth_rad(magnetic_rad: Array, declination_rad: float) -> Array:
    """From true north; the declination is positive where the needle points east of it. (...) in and out."""
    return wrapped(magnetic_rad + declination_rad)


def up_in_instrument(inclination_rad: Array, gravity_tool_face_rad: Array) -> Array:
    """The direction of up (..., 3) that two of the angles (...) stand for: they say all that gravity does."""
    sine = np.sin(inclination_rad)
    return np.stack(
        [
            -sine * np.sin(gravity_tool_face_rad),
            -sine * np.cos(gravity_tool_face_rad),
            np.cos(inclination_rad),
        ],
        axis=-1,
    )


def orientation(inclination_rad: Array, azimuth_rad: Array, tool_face_rad: Array) -> Array:
    """q_world_from_instrument (..., 4) of inclination, azimuth and gravity tool-face (...).

    Where the axis is vertical, only azimuth and tool-face together say how it stands.
    """
    tip = from_axis_angle([1.0, 0.0, 0.0], -np.asarray(inclination_rad))
    return multiply(multiply(heading_turn(-np.asarray(azimuth_rad)), tip), heading_turn(tool_face_rad))


def wrapped(angle_rad: Array) -> Array:
    """Into 0 to 2π, the end left out. Shape (...)."""
    turn = np.mod(angle_rad, 2.0 * np.pi)
    # the remainder of a tiny negative angle rounds to the divisor itself
    out: Array = np.where(turn >= 2.0 * np.pi, 0.0, turn)
    return out


def _across(v: Array) -> Array:
    out: Array = np.hypot(v[..., 0], v[..., 1])
    return out


def _turn(sine: Array, cosine: Array) -> Array:
    known = np.hypot(sine, cosine) > _SMALLEST_SINE
    return wrapped(np.where(known, np.arctan2(sine, cosine), np.nan))


def _unit(v: Array, least: float = 0.0) -> Array:
    """NaN where there is no direction."""
    norm = np.linalg.norm(v, axis=-1, keepdims=True)
    out: Array = v / np.where(norm > least, norm, np.nan)
    return out
