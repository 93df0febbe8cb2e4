"""Keep the robot's parts apart from each other and from zones: a velocity damper with room to brake.

Faverjon and Tournassoud (1987): the speed at which a pair may approach falls with its distance and is zero at
its margin,  d' ≥ -(d - margin) / τ.  Their damper takes for granted that a joint can do what it is told. Here
the joints have acceleration limits, so each velocity must also leave room to stop: were every joint to brake
from it as hard as it may (what `SetpointLimiter.stop` does after any loss), no pair may come nearer than its
margin on all the way to standstill. The way is looked at posture by posture, by conservative advancement.

Of all velocities that keep both, and the joints' own limits, the one nearest to the wish is taken (a
quadratic programme). There always is one: to brake, which the last step has left room for. A pair that is
nearer than its margin already may stay as it is or part, so the operator can always leave.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import daqp
import numpy as np

from common.quaternion import Array
from common.skeleton import Skeleton
from common.wire.messages import Mask
from slave.guard.zones import Zone, distance_model, speed_limits, zone_margins_m
from slave.limit.braking import BrakingWay, Looks, way_to_stop
from slave.model.distance import CLOSE_M, DistanceModel, NearPairs

TIME_CONSTANT_S = 0.1
"""τ: at 10 cm beyond the margin a pair may approach at 1 m/s."""
SKIN_M = 0.001
"""The damper stops this far before the margin, which rounding and curved ways then do not reach."""
DIP_M = 0.001
"""By so much a pair may come nearer between two looks at its way than it is at both."""
_BENT_M = 0.25
"""Radius by which ways are bent at most, where they are long enough to matter."""
FAR_M = 0.05
"""Looks at the way to standstill reach no further than this."""
MOST_ROWS = 32
"""Of one kind in one programme: those that matter most. What is left out the look at the way still sees."""
MOST_CUTS = 2
ABOUT_M = 0.002
"""Once a way is not free, what has no more than this to spare later on it is kept from using it up."""
BUDGET_NS = 3_000_000
"""A tick that has taken longer than this brakes."""
MOST_LATE = 10
"""So many late ticks in a row, and the robot holds."""
_NOTICED_RAD_S = 5e-4
"""A joint that loses less is not said to be held back. Far less than a gentle start gains in one step."""
_STANDS_RAD_S = 0.02
_FREE = 1e30


@dataclass(frozen=True, slots=True)
class DamperStep:
    """What the joints may do in this step, by their own limits; (J,) each."""

    position_rad: Array
    aim_rad_s: Array
    """The velocity that would be best for the joint's target, whatever its acceleration."""
    wish_rad_s: Array
    """As much of it as the joint can do in this step."""
    lowest_rad_s: Array
    highest_rad_s: Array
    braking_rad_s: Array
    """The velocity if every joint brakes as hard as it may."""
    max_velocity_rad_s: Array
    brake_rad_s2: Array
    dt_s: float


@dataclass(slots=True)
class _Rows:
    """Constraints `of @ v ≥ least`."""

    of: Array
    least: Array

    def violated_by(self, velocity: Array) -> bool:
        return bool((self.of @ velocity < self.least - 1e-9).any())

    def and_also(self, other: _Rows | None) -> _Rows:
        if other is None:
            return self
        return _Rows(np.vstack([self.of, other.of]), np.append(self.least, other.least))


def strides_m(model: DistanceModel, margins_m: Array) -> Array:
    """(R,) how far joints may bring pairs of each kind along each other between two looks, for `DIP_M`.

    Two parts that pass each other on an even way of length s, and keep their margin at both ends, are nearer
    by at most s² / 8 r in between, where r is the sum of their radii and the margin. A bent way adds as much,
    with the radius of its bend for r. So thin parts are looked at more often.
    """
    round_m = np.full(len(model.levers_m), np.inf)
    np.minimum.at(round_m, model.kind, np.where(np.isfinite(margins_m), model.radius_m + margins_m, np.inf))
    return np.asarray(np.sqrt(8.0 * DIP_M / (1.0 / np.maximum(round_m, DIP_M) + 1.0 / _BENT_M)))


class DistanceDamper:
    """Limits the velocity (J,) of every setpoint. `self_margin_cm` and `zones` are the guard's."""

    def __init__(self, skeleton: Skeleton, self_margin_cm: float, zones: Sequence[Zone] = ()) -> None:
        self._model = model = distance_model(skeleton, self_margin_cm, zones)
        margins_m = np.array(zone_margins_m(self_margin_cm, zones))[1 + model.obstacle]
        self._margin_m = margins_m
        self._slows = any(zone.max_speed_m_s is not None for zone in zones)
        # the robot's own parts have place -1
        self._most_m_s, self._slow_from_m = (
            np.append(a, b) for a, b in zip(speed_limits(zones), (np.inf, 0.0), strict=True)
        )
        kept = np.zeros(len(model.levers_m), np.bool_)
        np.logical_or.at(kept, model.kind, np.isfinite(margins_m))
        self._kept_m = np.where(kept, 0.0, np.inf)
        """(R,) inf for kinds of pairs that may meet."""
        self._stride_m = strides_m(model, margins_m)
        joints = model.levers_m.shape[1]
        self._cost = np.eye(joints), np.zeros(joints)
        self.clock: Callable[[], int] = lambda: 0
        """Tells how much time a step takes. The default takes none: on a virtual clock nothing is late."""
        self._late_in_a_row = 0
        self._suspect: int | None = None
        """The moment at which the way to standstill was not free, the last time."""
        self.held_back: Mask = np.zeros(model.levers_m.shape[1], np.bool_)
        """(J,) joints that were given less than they wished, in the newest step."""
        self._stands = False
        """Whether the robot does not slide along what holds it off either."""
        self._nearest: tuple[int, float] | None = None
        """The pair that is nearest to its margin while joints are held back, and its distance in m."""

    def limit(self, step: DamperStep) -> Array:
        """The velocity (J,) to go on with; `held_back` and `words` tell about it."""
        began_ns = self.clock()
        model = self._model
        model.pose(step.position_rad)
        closing_m_s = model.closing_m_s(step.wish_rad_s)
        # what the wish does not bring together in τ need not be found
        near = model.near_here(TIME_CONSTANT_S * float(closing_m_s.max(initial=0.0)) + SKIN_M)
        margin_m, closing_m_s = self._margin_m.take(near.pair), closing_m_s.take(near.pair)
        # what stands inside a margin already may not come nearer than it is
        floor_m = self._margin_m.copy()
        np.minimum.at(floor_m, near.pair, near.distance_m)
        spare_m = self._spare_m(near, floor_m)
        asked = step.wish_rad_s
        step, slow = self._slowed(near, closing_m_s, step)
        rows = self._damping(near.distance_m - margin_m - SKIN_M, closing_m_s, step).and_also(slow)
        velocity, late = step.wish_rad_s, False
        for _ in range(MOST_CUTS + 1):
            if rows.violated_by(velocity):
                velocity = self._nearest_to_the_aim(rows, step)
            late = self.clock() - began_ns > BUDGET_NS
            cut = None if late else self._cut(spare_m, floor_m, velocity, step)
            if cut is None:
                break
            rows = rows.and_also(cut)
        else:
            velocity = step.braking_rad_s
        if late:
            velocity = step.braking_rad_s
        self._late_in_a_row = self._late_in_a_row + 1 if late else 0
        self._stands = bool(np.abs(velocity).max() < _STANDS_RAD_S)
        self._tell(near, margin_m, np.abs(velocity - asked))
        return velocity

    def _damping(self, spare_m: Array, fastest_m_s: Array, step: DamperStep) -> _Rows:
        """The damper of every near pair that the wish could bring together too fast, at `fastest_m_s`."""
        rows = (spare_m < TIME_CONSTANT_S * fastest_m_s).nonzero()[0]
        if len(rows) > 2 * MOST_ROWS:
            rows = rows[np.argpartition(spare_m[rows], 2 * MOST_ROWS)[: 2 * MOST_ROWS]]
        gradient, spare_m = self._model.gradient(rows), spare_m[rows]
        # within its skin a pair parts again, gently; one that is inside its margin is only kept from more
        parting = np.where(spare_m > -SKIN_M, -spare_m, 0.0) / TIME_CONSTANT_S
        return self._possible(gradient, parting, step)

    def _slowed(
        self, near: NearPairs, fastest_m_s: Array, step: DamperStep
    ) -> tuple[DamperStep, _Rows | None]:
        """Aim and wish within the speed limits of zones, and rows that keep them in these directions."""
        if not self._slows:
            return step, None
        zone = self._model.obstacle.take(near.pair)
        further_m = np.maximum(near.distance_m - self._slow_from_m.take(zone), 0.0)
        most_m_s = self._most_m_s.take(zone) + further_m / TIME_CONSTANT_S
        rows = (most_m_s < fastest_m_s).nonzero()[0]
        if not len(rows):
            return step, None
        most_m_s = most_m_s[rows]
        velocity_m_s = self._model.velocity(rows, step.aim_rad_s)
        speed_m_s = np.sqrt((velocity_m_s * velocity_m_s).sum(axis=1))
        over = (speed_m_s > most_m_s).nonzero()[0]
        if not len(over):
            return step, None
        # all joints that move the part are slowed alike, so that it goes the same way
        moves = self._model.levers_m[self._model.kind[near.pair[rows[over]]]] > 0.0
        share = np.where(moves, (most_m_s[over] / speed_m_s[over])[:, None], 1.0).min(axis=0)
        aim = share * step.aim_rad_s
        wish = np.minimum(np.maximum(aim, step.lowest_rad_s), step.highest_rad_s)
        slowed = replace(step, aim_rad_s=aim, wish_rad_s=wish)
        over = over[np.argsort(most_m_s[over] / speed_m_s[over])[: MOST_ROWS // 2]]
        direction = velocity_m_s[over] / speed_m_s[over, None]
        return slowed, self._possible(-self._model.towards(rows[over], direction), -most_m_s[over], slowed)

    def _possible(self, of: Array, least: Array, step: DamperStep) -> _Rows:
        """The rows that matter most, each as far as the joints can keep it in this step."""
        lack = least - of @ step.wish_rad_s
        if len(least) > MOST_ROWS:
            most = np.argpartition(lack, -MOST_ROWS)[-MOST_ROWS:]
            of, least = of[most], least[most]
        middle, half = (
            0.5 * (step.lowest_rad_s + step.highest_rad_s),
            0.5 * (step.highest_rad_s - step.lowest_rad_s),
        )
        return _Rows(of, np.minimum(least, of @ middle + np.abs(of) @ half))

    def _cut(self, spare_m: Array, floor_m: Array, velocity: Array, step: DamperStep) -> _Rows | None:
        """What this velocity would break on the way to standstill, as rows that forbid it; None: nothing."""
        model, speed = self._model, np.abs(velocity)
        far_rad = speed * (step.dt_s + speed / (2.0 * step.brake_rad_s2))
        risky = (model.levers_m @ far_rad > spare_m).nonzero()[0]
        if not len(risky):
            return None
        way = way_to_stop(velocity, step.brake_rad_s2, step.dt_s)
        # no joint turns back on the way: what each adds only grows
        apart_m = np.abs(way.gone_rad) @ model.levers_m.take(risky, 0).T
        stride_m = self._stride_m.take(risky)
        # what is further away than that tells no more
        reach_m = min(max(0.5 * float(apart_m[-1].max()), CLOSE_M), FAR_M)
        looks = Looks(apart_m, spare_m.take(risky), stride_m, way.parts, reach_m)
        k = looks.next(self._suspect)
        while k is not None:
            then, cut = self._broken_at(k, reach_m, way, floor_m, step)
            if cut is not None:
                self._suspect = k
                return self._later_too(k, cut, reach_m, way, floor_m, step)
            looks.saw(k, self._spare_m(then, floor_m).take(risky))
            k = looks.next()
        self._suspect = None
        return None

    def _later_too(
        self, k: int, cut: _Rows, reach_m: float, way: BrakingWay, floor_m: Array, step: DamperStep
    ) -> _Rows:
        """The rows of moment k, and of what comes too near later: else each took a solution of its own."""
        last = len(way.gone_rad) - 1
        for later in {(k + last) // 2, last} - {k}:
            cut = cut.and_also(self._broken_at(later, reach_m, way, floor_m, step, ABOUT_M)[1])
        return cut

    def _spare_m(self, near: NearPairs, floor_m: Array) -> Array:
        """(R,) how far the pairs of each kind may come towards each other, at least."""
        spare_m = self._kept_m + near.reach_m
        np.minimum.at(spare_m, self._model.kind.take(near.pair), near.distance_m - floor_m.take(near.pair))
        return spare_m

    def _broken_at(
        self, k: int, reach_m: float, way: BrakingWay, floor_m: Array, step: DamperStep, about_m: float = 0.0
    ) -> tuple[NearPairs, _Rows | None]:
        """A look at moment k of a way, and rows that forbid what is too near then; None: nothing is.

        What is within `about_m` of being too near counts, too.
        """
        then = self._model.near(step.position_rad + way.gone_rad[k], reach_m)
        lack_m = floor_m.take(then.pair) - then.distance_m
        if lack_m.max(initial=-np.inf) <= -about_m:
            return then, None
        worst = np.argsort(-lack_m)[: min(np.count_nonzero(lack_m > -about_m), MOST_ROWS)]
        of = self._model.gradient(worst) * way.moving_s(k)
        return then, self._possible(of, lack_m[worst] + 0.3 * SKIN_M + of @ way.velocity_rad_s, step)

    def _nearest_to_the_aim(self, rows: _Rows, step: DamperStep) -> Array:
        """Solve for the v of min Σ ((v - aim) / v_max)² within bounds and rows.

        Not the wish: that has the last velocity in it, and a posture would swing along what it leans against.
        """
        scale, aim = step.max_velocity_rad_s, step.aim_rad_s
        of, scaled = rows.of, rows.of * scale
        bounds = (step.lowest_rad_s - aim) / scale, (step.highest_rad_s - aim) / scale
        highest = np.concatenate([bounds[1], np.full(len(of), _FREE)])
        # not all rows may be possible at once; what braking keeps of them is
        for least in (rows.least, None):
            if least is None:
                least = np.minimum(rows.least, of @ step.braking_rad_s)
            lowest = np.concatenate([bounds[0], least - of @ aim])
            change, _, found, _ = daqp.solve(*self._cost, scaled, highest, lowest)
            if found == 1:
                velocity = aim + np.asarray(change) * scale
                return np.minimum(np.maximum(velocity, step.lowest_rad_s), step.highest_rad_s)
        return step.braking_rad_s

    def _tell(self, near: NearPairs, margin_m: Array, lost_rad_s: Array) -> None:
        self.held_back = lost_rad_s > _NOTICED_RAD_S
        self._nearest = None
        if self.held_back.any() and len(near.pair):
            k = int(np.argmin(near.distance_m - np.maximum(margin_m, 0.0)))
            self._nearest = int(near.pair[k]), float(near.distance_m[k])

    def idle(self) -> None:
        """The robot brakes by order, or stands: nothing is held back."""
        self.held_back = np.zeros_like(self.held_back)
        self._nearest = None
        self._late_in_a_row = 0

    @property
    def overdue(self) -> str | None:
        """Why the robot must hold: for a while the distances could not be computed in time."""
        if self._late_in_a_row < MOST_LATE:
            return None
        return f"distances were not computed within {BUDGET_NS * 1e-6:g} ms, {MOST_LATE} times in a row"

    @property
    def words(self) -> str:
        """What is held back, and by what; empty: nothing."""
        if self._nearest is None:
            return ""
        pair, distance_m = self._nearest
        part, other = self._model.names[pair]
        off = f"{part} is held off by the {other}, {max(100.0 * distance_m, 0.0):.0f} cm from it"
        return f"{off}: go back the way you came" if self._stands else off
