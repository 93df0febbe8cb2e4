"""What wrong stamps can feign: never more than is said, and for the worst signs just that much."""

from __future__ import annotations

import itertools

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.quaternion import Array
from common.skeleton import load_skeleton
from slave.contact.config import ContactConfig
from slave.contact.observer import MomentumObserver
from slave.contact.stamps import StampNoise, weights
from slave.contact.watch import ContactWatch
from slave.encoders.counts import Encoders
from slave.model.build import build_model
from slave.servos.servos import EncoderReading

SKELETON = load_skeleton("nursing")
MODEL = build_model(SKELETON)
MODEL.opt.gravity[:] = 0.0
YAW = SKELETON.joint_names.index("neck_yaw")
RATE_RAD_S, ERROR_S, JITTER_S = 0.5, 3e-4, 5e-4


def turning(
    observer: MomentumObserver, step_s: float, errors: Array, told_s: float | Array
) -> tuple[Array, Array]:
    """Residual and what stamps can feign, (T,), of a neck that turns evenly: nothing pushes it."""
    residual, feigned = [], []
    told = np.broadcast_to(told_s, errors.shape).tolist()
    for k, error in enumerate(errors.tolist()):
        position = np.zeros(25)
        position[YAW] = RATE_RAD_S * (step_s * k + ERROR_S * error)
        observer.update(round(1e9 * step_s * (k + 1)), position, np.zeros(25), told[k])
        residual.append(observer.external_nm[YAW])
        feigned.append(observer.stamp_nm[0, YAW] if isinstance(observer.stamp_nm, np.ndarray) else 0.0)
    return np.array(residual), np.array(feigned)


@pytest.mark.parametrize(("step_s", "time_constant_s"), [(0.02, 0.004), (0.005, 0.004), (0.004, 0.01)])
def test_the_worst_signs_feign_what_is_said(step_s: float, time_constant_s: float) -> None:
    share = -np.expm1(-step_s / time_constant_s)
    count = 3 + int(12 * time_constant_s / step_s)
    # the impulse response, and with it the signs that add up
    impulse = np.zeros(4 * count)
    impulse[count:] = 1.0
    residual, _ = turning(MomentumObserver(SKELETON, (time_constant_s,), MODEL), step_s, impulse, 0.0)
    answer = np.diff(residual[count - 1 :])
    assert len(weights(share, count)) == count
    signs = np.sign(answer[:count])[::-1]
    errors = np.concatenate([np.zeros(2 * count), np.where(signs == 0.0, 1.0, signs)])
    residual, feigned = turning(
        MomentumObserver(SKELETON, (time_constant_s,), MODEL), step_s, errors, ERROR_S
    )
    assert abs(residual[-1]) <= 1.02 * feigned[-1]
    assert abs(residual[-1]) > 0.85 * feigned[-1]


@given(st.lists(st.floats(-1.0, 1.0), min_size=20, max_size=40), st.sampled_from([0.004, 0.005, 0.02]))
def test_no_signs_feign_more(signs: list[float], step_s: float) -> None:
    errors = np.array([0.0, 0.0, *signs])
    residual, feigned = turning(MomentumObserver(SKELETON, (0.01,), MODEL), step_s, errors, ERROR_S)
    assert (np.abs(residual[2:]) <= 1.02 * feigned[2:] + 1e-9).all()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_one_wrong_stamp_also_spoils_the_velocity_it_is_judged_by(sign: float) -> None:
    errors = np.zeros(60)
    errors[20] = sign
    observer = MomentumObserver(SKELETON, (0.01,), MODEL)
    residual, feigned = turning(observer, 0.004, errors, ERROR_S * np.abs(errors))
    # what is forgotten after twelve time constants is less than a thousandth
    assert (np.abs(residual) <= feigned + 1e-4).all()


def test_exact_stamps_cost_nothing() -> None:
    _, feigned = turning(MomentumObserver(SKELETON, (0.004,), MODEL), 0.005, np.zeros(30), 0.0)
    assert (feigned == 0.0).all()


def test_one_doubtful_stamp_is_forgotten() -> None:
    noise = StampNoise(2, 0.01)
    noise.add(0.005, 1e-3, np.array([1.0, 0.0]))
    assert noise.feigned_nm[0] > 0.0 == noise.feigned_nm[1]
    for _ in range(40):
        noise.add(0.005, 0.0, np.ones(2))
    assert (noise.feigned_nm == 0.0).all()


def watched(told_ns: int) -> ContactWatch:
    """A shoulder that turns at 2 rad/s whose readings are 0.5 ms early and late by turns."""
    watch, encoders = ContactWatch(SKELETON, ContactConfig()), Encoders(SKELETON)
    shoulder, data = SKELETON.joint_names.index("left_shoulder_pitch"), mujoco.MjData(watch.observer.model)
    for k, sign in zip(range(40), itertools.cycle((1.0, -1.0)), strict=False):
        position = np.clip(np.zeros(25), SKELETON.lower_rad, SKELETON.upper_rad)
        position[shoulder] += 2.0 * (0.02 * k + JITTER_S * sign)
        data.qpos[:] = position @ watch.observer.rates
        data.qvel[:] = 2.0 * watch.observer.rates[shoulder]
        mujoco.mj_fwdPosition(watch.observer.model, data)
        mujoco.mj_fwdVelocity(watch.observer.model, data)
        effort = watch.observer.rates @ data.qfrc_bias
        counts = encoders.counts(position)
        now_ns = 20_000_000 * (k + 1)
        reading = EncoderReading(now_ns, counts, np.ones(25, np.bool_), position, effort, told_ns)
        watch.look(now_ns, reading, encoders.position_rad(counts))
    return watch


def test_jitter_that_is_told_makes_no_false_stop_and_untold_does() -> None:
    assert watched(0).count > 0
    assert watched(round(1e9 * JITTER_S)).count == 0
