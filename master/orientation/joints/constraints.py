"""What a joint that cannot turn freely says of its two nodes' headings.

An elbow does not bend sideways and a knee neither bends sideways nor twists. Written with the intrinsic
angles α, β, γ of `Segment.axes` and its rotation R (parent from segment, in the frame of those axes):

    R02 = sβ     R01 = -cβ sγ     R12 = -sα cβ

so an angle that the person's joint lacks makes one entry of R vanish, and each entry is the product of an
axis u of the parent and an axis v of the segment: they stand square on each other. Seen in the world, turning
a node by its heading error θ about the vertical turns its axis, and

    h = u · v,   ∂h/∂θ_segment = z · (v × u) = -∂h/∂θ_parent

is what the error leaves, and how much of it shows: nothing, where v × u lies level. After Laidig, Lehmann,
Bégin and Seel (Magnetometer-free realtime inertial motion tracking by exploitation of kinematic constraints
in 2-DoF joints, EMBC 2019), who solve the same for one joint by Gauss-Newton over a window.
"""

from __future__ import annotations

import numpy as np

from common.quaternion import Array, rotate
from common.skeleton import Skeleton

_PRODUCT = ((1, 2), (0, 2), (0, 1))
"""For each of the three angles the columns of the axes' frame, parent's and segment's, kept square."""


class JointConstraints:
    """All pairs of axes, M of them, that a skeleton's joints keep square."""

    def __init__(self, skeleton: Skeleton) -> None:
        pairs = [
            (child, *_PRODUCT[angle])
            for child, segment in enumerate(skeleton.segments)
            if skeleton.parents[child] >= 0
            for angle in range(3)
            if not segment.human[angle]
        ]
        self.child = np.array([child for child, _, _ in pairs], dtype=np.intp)
        """(M,) index of the segment."""
        self.parent = skeleton.parents[self.child]
        """(M,) index of its parent."""
        frames = skeleton.axis_frames
        self._u_parent = np.array([frames[child, :, u] for child, u, _ in pairs]).reshape(-1, 3)
        self._v_child = np.array([frames[child, :, v] for child, _, v in pairs]).reshape(-1, 3)

    def __len__(self) -> int:
        return len(self.child)

    def measure(self, q_world_from_segment: Array) -> tuple[Array, Array]:
        """Give h (M,), 0 where the axes are square, and ∂h/∂θ (M,) of the segment's heading, 1/rad.

        The derivative by the parent's heading is the opposite. Takes orientations (N, 4).
        """
        u = rotate(q_world_from_segment.take(self.parent, axis=0), self._u_parent)
        v = rotate(q_world_from_segment.take(self.child, axis=0), self._v_child)
        return np.einsum("mi,mi->m", u, v), v[:, 0] * u[:, 1] - v[:, 1] * u[:, 0]
