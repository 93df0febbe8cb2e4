"""How hard the robot presses within a zone, by the torques from outside, against the zone's limit. Pure."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from common.quaternion import Array
from common.skeleton import Skeleton
from slave.guard.zones import Zone, distance_model
from slave.model.distance import CLOSE_M, Indices

TOUCHES_M = 0.01
"""A part so near to a zone's margin, or to the zone itself where parts may enter, counts as being there: the
damper keeps 1 mm, and a capsule is not exactly the part."""
RELEASE = 0.6
"""The contact has ended once the force is below this share of the limit."""
ABOUT = 0.5
"""Thresholds: torques that differ by less are the same."""


class ZoneForces:
    """The zones with `max_force_n`. Give it each reading's angles and torques from outside.

    The contact is taken to be where a part is nearest to the zone. Its force F is the least that explains the
    torques τ best, each as exactly as its threshold says:  min |W (Jᵀ F - τ)|,  W = 1 / threshold. Of several
    parts in one zone, the deepest of those that explain them about as well as the best counts. A direction in
    which the limit itself would not turn the joints by one threshold says nothing, and is left out.
    """

    def __init__(self, skeleton: Skeleton, zones: Sequence[Zone]) -> None:
        self._zones = [zone for zone in zones if zone.max_force_n is not None]
        self._model = distance_model(skeleton, 0.0, self._zones) if self._zones else None
        self._near_m = np.array([max(zone.margin_m, 0.0) + TOUCHES_M for zone in self._zones])
        self._beyond: set[int] = set()
        self.finding: str | None = None
        """In which zone the robot presses too hard, with what and how hard, for as long as it lasts."""

    def look(self, position_rad: Array, external_nm: Array | None, threshold_nm: Array) -> None:
        """Angles (J,), torques from outside (J,) with NaN where unknown, and the thresholds of these (J,)."""
        if self._model is None:
            return
        self.finding = None
        if external_nm is None:
            self._beyond.clear()
            return
        weight = np.where(np.isnan(external_nm) | np.isinf(threshold_nm), 0.0, 1.0 / threshold_nm)
        near = self._model.near(position_rad, CLOSE_M)
        owner = self._model.obstacle[near.pair]
        for place, zone in enumerate(self._zones):
            assert zone.max_force_n is not None
            rows = np.flatnonzero((owner == place) & (near.distance_m <= self._near_m[place]))
            rows = rows[np.argsort(near.distance_m[rows])]
            found = self._contact(rows, np.nan_to_num(external_nm), weight, zone.max_force_n)
            limit_n = zone.max_force_n * (RELEASE if place in self._beyond else 1.0)
            if found is None or found[1] <= limit_n:
                self._beyond.discard(place)
                continue
            self._beyond.add(place)
            pressed = f"{self._model.names[near.pair[found[0]]][0]} presses with {found[1]:.0f} N"
            words = f"{pressed} in the zone {zone.name}: more than {zone.max_force_n:g} N"
            self.finding = self.finding or words

    def _contact(
        self, rows: Indices, external_nm: Array, weight: Array, limit_n: float
    ) -> tuple[int, float] | None:
        """The row of the contact, deepest first, and its force in N; None: nothing is there."""
        assert self._model is not None
        if not len(rows):
            return None
        # (3, rows, J): how each joint moves each point
        axes = (np.broadcast_to(axis, (len(rows), 3)) for axis in np.eye(3))
        moves = np.stack([self._model.towards(rows, axis) for axis in axes])
        wanted = weight * external_nm
        forces_n, unexplained = [], []
        for k in range(len(rows)):
            turns = (moves[:, k] * weight).T
            into, per_n, across = np.linalg.svd(turns, full_matrices=False)
            tells = per_n * limit_n >= 1.0
            force = (into.T @ wanted)[tells] / per_n[tells] @ across[tells]
            unexplained.append(float(np.linalg.norm(turns @ force - wanted)))
            forces_n.append(float(np.linalg.norm(force)))
        first = int(np.argmax(np.array(unexplained) <= min(unexplained) + ABOUT))
        return int(rows[first]), forces_n[first]
