"""`tandem contact --hours`: a short way by all readings and loads, and what turns each verdict red."""

from __future__ import annotations

from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from common.errors import ConfigError
from common.quaternion import Array
from deploy.experiments.contact import hours
from deploy.experiments.contact.flight import Flight
from deploy.experiments.contact.flights import (
    LOADS,
    MASS_SHARE,
    MOTIONS,
    NOTHING,
    PAYLOAD_KG,
    READINGS,
    Flights,
    fly,
    motions_of,
    shares_s,
)
from deploy.experiments.contact.progress import FlightProgress
from deploy.measure.verdict import Outcome
from deploy.sim.patient.free_run import FreeFlight, FreeRun
from deploy.sim.patient.replay import Lap, held, replay
from deploy.sim.patient.robot import Imperfect
from slave.contact.config import ContactConfig

LAP = Lap(60.0, (), 0.5, "neck_yaw")
WHOLE = FreeRun(60.0, (), (), 0.5, "neck_yaw")
STOPPED = replace(LAP, findings=("pushed",))


@pytest.fixture(scope="module")
def short() -> Flights:
    return fly({"crossed": motions_of(None)["crossed"]}, 9.0, seed=3)


def test_a_short_way_has_no_false_stop(short: Flights) -> None:
    assert len(short.flights) == len(READINGS) * len(LOADS)
    for one in short.flights:
        assert one.seconds == pytest.approx(3.0)
        assert one.findings == (), one
        assert 0.02 < one.worst.nearest < 1.0
    assert all(verdict.outcome is Outcome.PASSED for verdict in hours.judge_flights(short))


def refuses(t_s: float) -> tuple[Array, Array]:
    raise AssertionError("nobody asked for this motion")


def test_a_run_that_was_stopped_goes_on_and_comes_to_the_same(short: Flights, tmp_path: Path) -> None:
    file, crossed = tmp_path / "hour.json", {"crossed": motions_of(None)["crossed"]}
    run: dict[str, object] = {"seed": 3}

    def stop(seconds: float) -> None:
        told.append(seconds)
        if len(told) == 4:
            raise KeyboardInterrupt

    told: list[float] = []
    with pytest.raises(KeyboardInterrupt):
        fly(crossed, 9.0, 3, stop, progress=FlightProgress(run, file))
    again = FlightProgress(run, file)
    again.resume()
    assert len(again.flights) == 4
    assert fly(crossed, 9.0, 3, progress=again) == short
    # what is whole is not flown again: this motion could not be
    whole = FlightProgress(run, file)
    whole.resume()
    assert fly({"crossed": refuses}, 9.0, 3, progress=whole) == short
    with pytest.raises(ConfigError, match="seed"):
        FlightProgress({"seed": 4}, file).resume()
    file.write_text("{}")
    with pytest.raises(ConfigError, match="cannot be read"):
        whole.resume()


def test_two_processes_come_to_the_same(short: Flights) -> None:
    assert fly({"crossed": motions_of(None)["crossed"]}, 9.0, 3, jobs=2) == short


def red(lap: Lap = LAP, whole: FreeRun = WHOLE, load: str = NOTHING) -> list[str]:
    found = Flights({"bottle": whole}, (Flight("bottle", "12 bits", load, (LAP, lap)),))
    return [v.name for v in hours.judge_flights(found) if v.outcome is Outcome.FAILED]


def test_each_verdict_turns_red_by_one_stop() -> None:
    assert red() == []
    for load in LOADS:
        assert red(lap=STOPPED, load=load) == [f"false stops, the hand holds {load}"]
    assert red(whole=replace(WHOLE, false_stops=("pushed",))) == ["false stops, whole pipeline"]
    assert red(whole=replace(WHOLE, other_stops=("moves",))) == ["stops for other reasons"]


def test_table_and_tree_tell_each(short: Flights) -> None:
    assert hours.flights_table(short.flights).row_count == len(short.flights)
    tree = hours.flights_tree(short)
    assert isinstance(tree["flights"], list)
    assert {one["readings"] for one in tree["flights"]} == set(READINGS)


def test_a_file_that_other_code_began_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(
        hours, "motions_of", lambda person: {"still": lambda t_s: (np.zeros(25), np.zeros(25))}
    )
    file = tmp_path / "hour.json"

    def go_on() -> None:
        hours.follow_for(0.0004, None, 1, Console(file=StringIO()), resume=file)

    go_on()
    go_on()
    monkeypatch.setattr(hours, "code_state", lambda: "0123456789abcdef")
    with pytest.raises(ConfigError, match=r"has code '[0-9a-f]{16}', and this run has '0123456789abcdef'"):
        go_on()


def test_people_are_followed_without_a_false_stop(recordings_folder: Path) -> None:
    found = fly({"person": motions_of(recordings_folder / "motion_cmu.npz")["person"]}, 15.0, seed=1)
    assert all(verdict.outcome is Outcome.PASSED for verdict in hours.judge_flights(found))


THROWN_S = 442.0
"""Soon after, somebody throws his arm: what the hand holds turns the robot's forearm into its end stop."""


def test_a_forearm_that_is_thrown_into_its_end_stop_is_no_contact(recordings_folder: Path) -> None:
    person = motions_of(recordings_folder / "motion_cmu.npz")["person"]
    flight = FreeFlight(lambda t_s: person(t_s + THROWN_S), Imperfect(mass_share=MASS_SHARE), ContactConfig())
    flight.follow(6.0)
    for name, readings in READINGS.items():
        carries = replace(readings, payload_kg=PAYLOAD_KG)
        lap = replay(flight.setpoints_rad, carries, ContactConfig(), held(PAYLOAD_KG))
        assert lap.findings == (), name
        assert lap.nearest < 0.9, name


def test_an_hour_covers_the_whole_recording_of_people_by_each_kind_of_readings(
    recordings_folder: Path,
) -> None:
    motions = motions_of(recordings_folder / "motion_cmu.npz")
    shares = shares_s(motions, 3600.0 / len(READINGS))
    assert sum(shares.values()) == pytest.approx(1200.0)
    assert shares["person"] == pytest.approx(695.0, abs=1.0)
    assert shares["bottle"] == shares["crossed"] > 100.0
    # where it does not fit, the motions still get their part; alone it gets all
    assert shares_s(motions, 100.0) == pytest.approx({"person": 75.0, **dict.fromkeys(MOTIONS, 25.0 / 3.0)})
    assert shares_s({"person": motions["person"]}, 15.0) == {"person": 15.0}


def test_the_time_is_that_asked_for_and_is_told_as_it_goes(monkeypatch: pytest.MonkeyPatch) -> None:
    def still(t_s: float) -> tuple[Array, Array]:
        return np.zeros(25), np.zeros(25)

    monkeypatch.setattr(hours, "motions_of", lambda person: {"still": still})
    tables, tree, verdicts = hours.follow_for(0.0004, None, 1, Console(file=StringIO()))
    assert len(tables) == 2
    assert [one["seconds"] for one in tree["flights"]] == pytest.approx([0.48] * 6)  # type: ignore[attr-defined]
    assert [verdict.outcome for verdict in verdicts] == [Outcome.PASSED] * 4
