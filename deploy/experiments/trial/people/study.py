"""What is followed, over which lines, and the limits that `predict` is judged by. Pure."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property

from common.skeleton import Skeleton
from deploy.experiments.trial.people.figures import PeopleFigures, figures
from deploy.experiments.trial.people.followed import FOREKNOWN, Followed, Line, follow
from deploy.measure.verdict import Verdict, at_most
from deploy.sim.suit.people import Clip, spline

ONE_WAY_MS = (25, 80, 150, 300)
SLOWER = (1.0, 1.5)
RATES_HZ = (12.5, 25.0)
JUDGED_HZ = 25.0
LEAST_RMSE = {1.0: (0.45, 0.60, 0.75, 0.88), 1.5: (0.34, 0.46, 0.59, 0.78)}
"""RMSE over that of `latest` at 12.5 Hz, by `ONE_WAY_MS`."""
MOST_ROUGHNESS, MOST_OVERSHOOT_DEG = (2.0, 2.0, 2.5, None), (3.0, 3.0, 4.5, None)
MOST_STILL_DEG = 0.1
MOST_RUNNING = 1.05
ROUGH_LINE_MS, ROUGH_LOSS, ROUGH_JITTER_S, MOST_ROUGH_LINE = 80, 0.03, 0.02, 1.12


@dataclass(frozen=True, slots=True)
class Row:
    """One strategy over one line."""

    slower: float
    line: Line
    strategy: str
    found: PeopleFigures
    over_latest: float
    """RMSE over that of `latest` over the same line at 12.5 Hz, without loss and jitter."""
    unlimited_over_latest: float
    """The same, had the joints no limits of speed and acceleration: what prediction alone gives."""

    def tree(self) -> dict[str, object]:
        """As JSON."""
        return {
            "slower": self.slower, "strategy": self.strategy, "rmse_over_latest": self.over_latest,
            "unlimited_over_latest": self.unlimited_over_latest,
            **asdict(self.line), **asdict(self.found),
        }  # fmt: skip


def shoulders(skeleton: Skeleton) -> tuple[tuple[int, int, int], ...]:
    """Columns of pitch, roll and yaw of each shoulder."""
    names, sides = skeleton.joint_names, ("left", "right")
    found = [[names.index(f"{side}_shoulder_{axis}") for axis in ("pitch", "roll", "yaw")] for side in sides]
    return tuple((pitch, roll, yaw) for pitch, roll, yaw in found)


def rows(
    clips: Sequence[Clip],
    skeleton: Skeleton,
    strategies: Sequence[str],
    slower: Sequence[float] = SLOWER,
    seed: int = 1,
) -> Iterator[Row]:
    """Each strategy at each rate over each line; a poor line; what limits leave of full knowledge."""
    for slow in slower:
        one = _Lines(clips, skeleton, slow, seed)
        for ms in ONE_WAY_MS:
            plain = Line(ms / 1e3)
            below = one.figures("latest", plain)
            for strategy in strategies:
                for rate_hz in RATES_HZ:
                    line = Line(ms / 1e3, rate_hz)
                    found = below if (strategy, line) == ("latest", plain) else one.figures(strategy, line)
                    yield _row(slow, line, strategy, found, below)
            if ms == ROUGH_LINE_MS and "predict" in strategies:
                poor = Line(ms / 1e3, JUDGED_HZ, ROUGH_JITTER_S, ROUGH_LOSS)
                found = one.figures("predict", poor)
                yield _row(slow, poor, "predict", found, below)
            yield _row(slow, plain, FOREKNOWN, one.foreknown, below)


def _row(slower: float, line: Line, strategy: str, found: PeopleFigures, latest: PeopleFigures) -> Row:
    unlimited = found.unlimited_rmse_deg / latest.unlimited_rmse_deg
    return Row(slower, line, strategy, found, found.rmse_deg / latest.rmse_deg, unlimited)


@dataclass(frozen=True)
class _Lines:
    clips: Sequence[Clip]
    skeleton: Skeleton
    slower: float
    seed: int

    def figures(self, strategy: str, line: Line) -> PeopleFigures:
        """Of all clips."""
        return figures(self._followed(strategy, line), shoulders(self.skeleton))

    @cached_property
    def foreknown(self) -> PeopleFigures:
        """Of a robot that is told what the operator will do: alike over every line."""
        return self.figures(FOREKNOWN, Line(0.0))

    def _followed(self, strategy: str, line: Line) -> Iterator[Followed]:
        for n, clip in enumerate(self.clips):
            course = spline(clip.position_rad, clip.rate_hz)
            yield follow(course, self.slower, self.skeleton, strategy, line, 100 * self.seed + n)


def running(clips: Sequence[Clip]) -> list[Clip]:
    """Those of people who run."""
    return [clip for clip in clips if "run" in clip.label]


def verdicts(done: Sequence[Row], running_ratio: float | None) -> list[Verdict]:
    """The limits of `predict`, at 25 commands a second."""
    mine = [row for row in done if row.strategy == "predict" and row.line.rate_hz == JUDGED_HZ]
    found: list[Verdict] = []
    for row in mine:
        found += _of_line(row) if not row.line.loss else [_of_poor_line(row, mine)]
    why = "" if running_ratio is not None else "nobody runs in this recording"
    found.append(at_most("running: RMSE / latest", running_ratio, MOST_RUNNING, why=why))
    return found


def _of_line(row: Row) -> list[Verdict]:
    ms = round(1e3 * row.line.one_way_s)
    k, group = ONE_WAY_MS.index(ms), f"{_speed(row.slower)}, {ms} ms"
    one: Callable[[str, float, float, str], Verdict] = lambda name, value, limit, unit: at_most(  # noqa: E731
        f"{group}: {name}", value, limit, unit
    )
    found = (
        [one("RMSE / latest", row.over_latest, LEAST_RMSE[row.slower][k], "")]
        if row.slower in LEAST_RMSE
        else []
    )
    rough, over = MOST_ROUGHNESS[k], MOST_OVERSHOOT_DEG[k]
    if rough is not None and over is not None:
        found += [
            one("roughness", row.found.roughness, rough, ""),
            one("overshoot, 99 %", row.found.overshoot_deg, over, "°"),
        ]
    return [*found, one("standing still", row.found.still_deg, MOST_STILL_DEG, "°")]


def _of_poor_line(row: Row, done: Sequence[Row]) -> Verdict:
    same = next(
        r for r in done
        if r.slower == row.slower and not r.line.loss and r.line.one_way_s == row.line.one_way_s
    )  # fmt: skip
    name = f"{_speed(row.slower)}, {ROUGH_LINE_MS} ms: RMSE with 3 % loss and 20 ms jitter / without"
    return at_most(name, row.found.rmse_deg / same.found.rmse_deg, MOST_ROUGH_LINE)


def _speed(slower: float) -> str:
    return "natural speed" if slower == 1.0 else f"{slower:g} × slower"
