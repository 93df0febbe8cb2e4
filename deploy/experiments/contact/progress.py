"""Which ways through the air are flown already, in a file: a run that was stopped goes on from there."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from common.errors import ConfigError, ConfigMistake
from deploy.experiments.contact.flight import Flight
from deploy.report.output import write_json
from deploy.sim.patient.free_run import FreeRun


@dataclass(frozen=True, slots=True)
class _File:
    """As it is written."""

    run: dict[str, object]
    by_pipeline: dict[str, FreeRun]
    flights: tuple[Flight, ...]


_READ = TypeAdapter(_File)


class FlightProgress:
    """What is done of a run; `run` names everything that must be the same to go on from it."""

    def __init__(self, run: dict[str, object], file: Path | None = None) -> None:
        self._run, self._file = run, file
        self.by_pipeline: dict[str, FreeRun] = {}
        self.flights: dict[tuple[str, str, str], Flight] = {}
        """By load, readings and motion."""

    def resume(self) -> None:
        """Take what the file has, if there is one. Raises ConfigError where it is of another run."""
        if self._file is None or not self._file.exists():
            return
        try:
            found = _READ.validate_json(self._file.read_bytes())
        except (ValidationError, OSError) as error:
            raise self._refused(f"cannot be read: {error}") from None
        for key, value in self._run.items():
            if found.run.get(key) != value:
                raise self._refused(f"has {key} {found.run.get(key)!r}, and this run has {value!r}")
        self.by_pipeline = found.by_pipeline
        self.flights = {(one.load, one.readings, one.motion): one for one in found.flights}

    def _refused(self, why: str) -> ConfigError:
        assert self._file is not None
        expected = "the file of a run with the same settings by the same code, or a new name"
        return ConfigError(self._file, [ConfigMistake("--resume", why, expected)])

    def followed(self, motion: str, found: FreeRun) -> None:
        """The whole pipeline has followed a motion."""
        self.by_pipeline[motion] = found
        self._write()

    def flew(self, flight: Flight) -> None:
        """One motion is done by one kind of readings, with one load."""
        self.flights[flight.load, flight.readings, flight.motion] = flight
        self._write()

    def _write(self) -> None:
        if self._file is None:
            return
        new = self._file.with_suffix(".new")
        write_json(new, asdict(_File(self._run, self.by_pipeline, tuple(self.flights.values()))))
        new.replace(self._file)
