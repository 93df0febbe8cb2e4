"""Truth in another frame or order: found, said, and taken out on request."""

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from common.quaternion import Array, angle_between, conjugate, from_rotation_vector, multiply
from deploy import cli
from deploy.experiments.accuracy.broad import errors, score
from deploy.experiments.accuracy.frames import fit, hint

from .test_files import saved, trial

ALL = np.ones(300, dtype=np.bool_)


def turns(seed: int) -> tuple[Array, Array]:
    """A truth and an estimate half a degree off it."""
    rng = np.random.default_rng(seed)
    truth = Rotation.random(300, rng=rng).as_quat(scalar_first=True)
    return truth, multiply(truth, from_rotation_vector(np.radians(0.5) * rng.normal(size=(300, 3))))


@pytest.mark.parametrize("seed", range(12))
def test_both_constant_rotations_are_found(seed: int) -> None:
    truth, estimate = turns(seed)
    world, sensor = Rotation.random(2, rng=100 + seed).as_quat(scalar_first=True)
    seen = multiply(multiply(world, truth), sensor)
    seen[::7] *= -1.0
    seen[5] = np.nan
    found = fit(estimate, seen, ALL)
    off = np.delete(angle_between(found.applied(seen), truth), 5)
    assert np.degrees(np.max(off)) < 0.3


def test_a_good_truth_is_hardly_changed_and_needs_no_hint() -> None:
    truth, estimate = turns(0)
    assert np.degrees(np.max(angle_between(fit(estimate, truth, ALL).applied(truth), truth))) < 0.3
    assert hint(estimate, truth, ALL) is None


def test_what_would_explain_the_error_is_said() -> None:
    truth, estimate = turns(1)
    turned = multiply(truth, from_rotation_vector(np.array([0.0, 1.0, 0.0])))
    said = hint(estimate, turned, ALL) or ""
    assert re.fullmatch(r"57\.\d\d° in all would be 0\.\d\d° with --align", said)
    assert "conjugated" in (hint(estimate, conjugate(truth), ALL) or "")
    assert "xyzw: write it wxyz" in (hint(estimate, np.roll(truth, -1, axis=1), ALL) or "")


def test_an_error_that_nothing_explains_gets_no_hint() -> None:
    truth, _ = turns(2)
    assert hint(turns(3)[0], truth, ALL) is None


def test_a_score_names_what_was_not_estimated_and_has_a_bound() -> None:
    truth, estimate = turns(4)
    for gaps, told in ((0, True), (15, True), (16, False), (200, False)):
        holed = estimate.copy()
        holed[:gaps] = np.nan
        found = score(errors(holed, truth), ALL)
        assert found.estimated == pytest.approx(1.0 - gaps / 300)
        assert (found.total_deg is not None) == told


def test_the_command_hints_and_aligns(tmp_path: Path) -> None:
    truth = trial()["quat"]
    turned = multiply(truth, from_rotation_vector(np.array([0.3, 0.8, -0.5])))
    path = saved(tmp_path, quat=turned)
    plain = CliRunner().invoke(cli.app, ["accuracy", str(path), "--filter", "vqf"])
    assert plain.exit_code == 0, plain.output
    assert "--align" in plain.output
    aligned = CliRunner().invoke(cli.app, ["accuracy", str(path), "--filter", "vqf", "--align"])
    assert aligned.exit_code == 0, aligned.output
    told = " ".join(aligned.output.split())
    assert "vqf aligned: world side" in told
    assert "sensor side 56.7" in told
