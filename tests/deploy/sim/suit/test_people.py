from pathlib import Path

import numpy as np
import pytest

from common.errors import ConfigError
from common.skeleton import load_skeleton
from deploy.sim.suit.motion import load_motion
from deploy.sim.suit.people import FOLDER, STILL_S, PeopleConfig, load_clips
from slave.track.persistence import Persistence

from .synthetic_people import RATE_HZ, motion, write

SKELETON = load_skeleton("nursing")


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("people") / "made.npz")


def test_the_made_up_motion_is_like_peoples() -> None:
    position = motion(5, 20.0)
    velocity = np.gradient(position, 1.0 / RATE_HZ, axis=0)
    speeds = np.degrees(velocity.std(axis=0))
    assert speeds.min() > 15.0
    assert speeds.max() < 120.0
    persistence = Persistence()
    for k in range(0, len(position), 8):
        persistence.note(round(k / RATE_HZ * 1e9), velocity[k])
    assert 7.0 < float(np.median(persistence.omega_per_s)) < 15.0
    still = np.abs(np.degrees(velocity)).max(axis=1) < 15.0
    assert 0.1 < still.mean() < 0.7


def test_people_are_kept_back_to_judge_by(file: Path) -> None:
    judged = load_clips(PeopleConfig(file=file), SKELETON)
    tuned = load_clips(PeopleConfig(file=file, who="tuned on"), SKELETON)
    assert {clip.subject for clip in judged} == {"made1", "made2"}
    assert {clip.subject for clip in tuned} == {"cmu01", "cmu02"}


def test_every_posture_is_within_the_robots_limits(file: Path) -> None:
    for clip in load_clips(PeopleConfig(file=file), SKELETON):
        assert (clip.position_rad >= SKELETON.lower_rad).all()
        assert (clip.position_rad <= SKELETON.upper_rad).all()


@pytest.mark.parametrize("slower", [1.0, 1.5])
def test_the_motion_begins_still_and_is_smooth_all_the_way(file: Path, slower: float) -> None:
    config = PeopleConfig(file=file, slower=slower)
    whole = load_motion("capture", SKELETON, config)
    time_s, h = np.arange(0.0, whole.period_s, 0.005), 1e-4
    position, velocity, acceleration = whole.state(time_s)
    before, after = whole.state(time_s - h)[0], whole.state(time_s + h)[0]
    np.testing.assert_allclose((after - before) / (2.0 * h), velocity, atol=2e-3)
    assert np.abs(velocity[time_s < STILL_S - 0.1]).max() < 0.01
    assert np.abs(np.degrees(acceleration)).max() < 12_000.0
    assert whole.period_s > slower * 12.0
    np.testing.assert_allclose(whole.state(whole.period_s)[0], position[0], atol=1e-9)


def test_slower_is_the_same_way_at_less_speed(file: Path) -> None:
    speeds = []
    for slower in (1.0, 1.5):
        whole = load_motion("capture", SKELETON, PeopleConfig(file=file, slower=slower))
        time_s = np.arange(6.0, 6.0 + 5.0 * slower, 0.005)
        speeds.append(np.sqrt(np.mean(whole.state(time_s)[1] ** 2)))
    assert speeds[0] == pytest.approx(1.5 * speeds[1], rel=0.15)


def test_without_a_recording_it_says_what_is_missing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv(FOLDER, raising=False)
    with pytest.raises(ConfigError, match=FOLDER):
        load_motion("capture", SKELETON)
    monkeypatch.setenv(FOLDER, str(tmp_path))
    with pytest.raises(ConfigError, match=r"motion_cmu\.npz"):
        load_motion("capture", SKELETON)


def test_a_file_of_something_else_is_refused_with_the_reason(tmp_path: Path) -> None:
    np.savez(tmp_path / "other.npz", gyr=np.zeros(3))
    with pytest.raises(ConfigError, match="joints"):
        load_clips(PeopleConfig(file=tmp_path / "other.npz"), SKELETON)
    (tmp_path / "text.npz").write_text("no array")
    with pytest.raises(ConfigError, match=r"people\.file"):
        load_clips(PeopleConfig(file=tmp_path / "text.npz"), SKELETON)


def test_another_robot_cannot_play_it(file: Path) -> None:
    with pytest.raises(ConfigError, match="motion"):
        load_motion("capture", load_skeleton("hand"), PeopleConfig(file=file))
