"""A magnetometer that changes while worn is told, and believed less, by every filter."""

import numpy as np
import pytest

from common.quaternion import Array, angle_between, conjugate, from_rotation_vector, multiply, rotate
from master.orientation.field_watch import FieldWatch
from master.orientation.filter import OrientationFilter
from master.orientation.filters import FILTERS
from master.suit.doubt import Weight

from .perfect import FIELD_UT, GRAVITY, attitudes
from .test_recordings import TRIALS, LoadRecording

RATE_HZ = 100.0
NAMES = ("vqf", "mahony", "ekf")
IRON_UT = np.array([0.0, 10.0, 0.0])


def unwatched(name: str) -> OrientationFilter:
    return FILTERS[name].model_validate({"field_change": 0.0}).make(RATE_HZ, 1)


def turning(filter_: OrientationFilter, seconds: float, iron_from_s: float, offset_ut: Array) -> float:
    """RMS error, °, over the last 15 s of a sensor that turns to and fro, as an arm does."""
    rng, q, errors = np.random.default_rng(0), attitudes(1, 2), []
    for tick in range(round(seconds * RATE_HZ)):
        t_s = tick / RATE_HZ
        rate = np.array([[1.5 * np.sin(1.9 * t_s), 1.2 * np.sin(1.3 * t_s + 1.0), np.sin(0.7 * t_s)]])
        q = multiply(q, from_rotation_vector(rate / RATE_HZ))
        mag = rotate(conjugate(q), FIELD_UT[None]) + 0.5 * rng.normal(size=(1, 3))
        if t_s >= iron_from_s:
            mag += offset_ut
        acc = rotate(conjugate(q), GRAVITY[None]) + 0.1 * rng.normal(size=(1, 3))
        filter_.update(rate + 0.002 * rng.normal(size=(1, 3)), acc, mag)
        if t_s > seconds - 15.0:
            errors.append(angle_between(filter_.q_world_from_sensor(), q)[0])
    return float(np.degrees(np.sqrt(np.mean(np.square(errors)))))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.long
def test_hard_iron_is_told_and_believed_less(name: str, axis: int) -> None:
    offset = np.roll(IRON_UT, axis - 1) * 1.5
    filter_ = FILTERS[name]().make(RATE_HZ, 1)
    clean = turning(FILTERS[name]().make(RATE_HZ, 1), 50.0, 99.0, offset)
    watched, before = turning(filter_, 50.0, 20.0, offset), turning(unwatched(name), 50.0, 20.0, offset)
    (doubt,) = filter_.doubts().values()
    assert doubt.weight is Weight.NOTED
    assert "its magnetic field is" in doubt.words
    assert watched < max(0.7 * before, clean + 1.5)


@pytest.mark.parametrize("name", NAMES)
def test_in_the_earth_s_field_alone_nothing_is_doubted_or_changed(name: str) -> None:
    filter_, plain = FILTERS[name]().make(RATE_HZ, 1), unwatched(name)
    assert turning(filter_, 30.0, 99.0, IRON_UT) == turning(plain, 30.0, 99.0, IRON_UT)
    assert filter_.doubts() == {}


def looks(watch: FieldWatch, field_ut: Array, seconds: float) -> None:
    upright = np.tile([1.0, 0.0, 0.0, 0.0], (len(field_ut), 1))
    for _ in range(round(seconds / 0.2)):
        watch.look(field_ut, np.isfinite(field_ut[:, 0]), upright, 0.2)


@pytest.mark.parametrize(("factor", "doubted"), [(1.09, False), (1.11, True), (0.91, False), (0.89, True)])
def test_the_share_is_the_bound(factor: float, doubted: bool) -> None:
    watch, field = FieldWatch(0.1, 1), FIELD_UT[None]
    looks(watch, field, 600.0)
    # a jump: the mean goes to its square within some seconds, the reference follows with 60 s
    for _ in range(60):
        watch._state.reference[:] = [[48.01, 54.32]]
        looks(watch, factor * field, 0.2)
    assert bool(watch.doubted[0]) == doubted
    looks(watch, field, 20.0)
    assert not watch.doubted[0]


def test_what_all_nodes_see_is_another_place_and_not_their_fault() -> None:
    watch, field = FieldWatch(0.1, 5), np.tile(FIELD_UT, (5, 1))
    looks(watch, field, 30.0)
    looks(watch, 1.3 * field, 30.0)
    assert not watch.doubted.any()
    own = 1.3 * field
    own[2, 0] += 30.0
    looks(watch, own, 10.0)
    assert watch.doubted.tolist() == [False, False, True, False, False]


def test_on_broad_only_a_change_is_told(recording: LoadRecording) -> None:
    for name in TRIALS:
        trial = recording(name)
        gyr, acc = (np.ascontiguousarray(trial[key]) for key in ("gyr", "acc"))
        ticks, rate_hz = 16_000, float(trial["rate_hz"])
        for iron_ut, told in ((0.0, False), (10.0, True)):
            filter_ = FILTERS["vqf"]().make(rate_hz, 1)
            said = False
            for tick in range(ticks):
                mag = trial["mag"][tick].copy()
                mag[2] += iron_ut if tick > ticks // 2 else 0.0
                filter_.update(gyr[tick][None], acc[tick][None], mag[None])
                said = said or (tick % 286 == 0 and bool(filter_.doubts()))
            assert said == told, (name, iron_ut)
