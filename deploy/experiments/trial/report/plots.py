"""The plots of the report, as SVG."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from deploy.experiments.trial.cell.figures import BY_NAME
from deploy.experiments.trial.cell.plan import Setup
from deploy.experiments.trial.cell.result import CellStatus, Excerpt
from deploy.experiments.trial.report.spread import SetupResults
from deploy.report.plots import BAR_COLOUR, INK, LIMIT_COLOUR, colour, svg

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MARKS = "osD^vPX*"


@dataclass(frozen=True, slots=True)
class Plot:
    """One figure."""

    title: str
    caption: str
    image: str


def plots(rows: Sequence[SetupResults]) -> list[Plot]:
    """The plots for which there is data."""
    rows = [row for row in rows if row.done]
    made = [
        _per_setup(rows, "rmse_deg", "Same-instant tracking error",
                   "What the patient sees: encoders against the operator at the same moment. Dots are "
                   "repeats, bars their median."),
        _trade(rows),
        _latency(rows),
        _motion(rows),
        _per_setup(rows, "flow_s", "Back after an outage",
                   "Time from the link's return to the first command that the guard accepts; dashed: the "
                   "limit of 1.5 s.", line=1.5),
        _per_setup(rows, "up_kb_s", "Load on the line, operator → robot",
                   "Bytes on the wire, headers and acknowledgements included, without video."),
    ]  # fmt: skip
    return [plot for plot in made if plot is not None]


def _per_setup(
    rows: Sequence[SetupResults], name: str, title: str, caption: str, line: float | None = None
) -> Plot | None:
    """Setups along x by network, one figure up; every repeat shown."""
    shown = [row for row in rows if name in row.spreads]
    if not shown:
        return None
    figure = BY_NAME[name]
    strategies = _names(row.setup.strategy for row in shown)

    def draw(axes: Axes) -> None:
        places = _places(axes, shown)
        for row, x in zip(shown, places, strict=True):
            tint = colour(strategies.index(row.setup.strategy))
            axes.bar(x, row.spreads[name].median, width=0.7, color=tint, alpha=0.45, linewidth=0)
            values = [value for cell in row.done if (value := cell.values.get(name)) is not None]
            axes.plot([x] * len(values), values, "o", color=tint, markersize=4, zorder=3)
        if line is not None:
            axes.axhline(line, color=LIMIT_COLOUR, linestyle="--", linewidth=1)
        axes.set_ylabel(f"{figure.title}, {figure.unit}" if figure.unit else figure.title)
        axes.set_ylim(bottom=0)
        axes.grid(axis="x", visible=False)
        _legend(axes, strategies)

    return Plot(title, caption, _svg(draw, width=max(6.5, 1.5 + 0.32 * len(shown))))


def _trade(rows: Sequence[SetupResults]) -> Plot | None:
    """Error against roughness: a good setup is at the lower left."""
    shown = [row for row in rows if {"rmse_deg", "roughness"} <= row.spreads.keys()]
    if not shown:
        return None
    strategies = _names(row.setup.strategy for row in shown)
    profiles = _names(row.setup.profile for row in shown)

    def draw(axes: Axes) -> None:
        for row in shown:
            x, y = row.spreads["roughness"], row.spreads["rmse_deg"]
            axes.errorbar(
                x.median, y.median,
                xerr=[[x.median - x.low], [x.high - x.median]],
                yerr=[[y.median - y.low], [y.high - y.median]],
                color=colour(strategies.index(row.setup.strategy)),
                marker=MARKS[profiles.index(row.setup.profile) % len(MARKS)],
                markersize=6, linewidth=0.8, alpha=0.85,
            )  # fmt: skip
        axes.axvline(3.0, color=LIMIT_COLOUR, linestyle="--", linewidth=1)
        axes.set_xlabel("roughness: RMS acceleration, robot over operator")
        axes.set_ylabel("RMSE at the same instant, °")
        axes.set_ylim(bottom=0)
        axes.set_xlim(left=0)
        _legend(axes, strategies, profiles)

    return Plot(
        "Accuracy against smoothness",
        "Lower left is better. Colour: strategy; mark: network; a mark for each transport, with the range "
        "of its repeats; dashed: the roughness that care allows.",
        _svg(draw, height=3.6),
    )


def _latency(rows: Sequence[SetupResults]) -> Plot | None:
    """One-way as measured with its bound, beside the true one; each network on its own scale."""
    shown = [row for row in rows if row.median("one_way_p50_ms") is not None]
    if not shown:
        return None
    profiles = _names(row.setup.profile for row in shown)
    groups = [[row for row in shown if row.setup.profile == profile] for profile in profiles]

    def draw_all(figure: Figure) -> None:
        sizes = [len(group) + 1.5 for group in groups]
        grid = figure.subplots(1, len(groups), squeeze=False, width_ratios=sizes)[0]
        for group, axes in zip(groups, grid, strict=True):
            for row, x in zip(group, _places(axes, group), strict=True):
                _one_way(axes, row, x)
            axes.set_ylim(bottom=0)
            axes.grid(axis="x", visible=False)
        grid[0].set_ylabel("one way, ms")
        grid[0].bar(0, 0, color=BAR_COLOUR, label="p50 by the measured offset; whisker: its bound")
        grid[0].plot([], [], "_", color=LIMIT_COLOUR, markeredgewidth=1.6, label="p99")
        grid[0].plot([], [], "o", color=INK, markersize=4, label="true p50, by the shared clock")
        figure.legend(loc="outside lower left", ncols=3)

    size = (max(6.5, 1.0 + 0.32 * len(shown) + 0.55 * len(groups)), 3.3)
    return Plot(
        "One-way latency of commands",
        "Where the dot lies within the whisker, the bound held. Each network has its own scale.",
        svg(draw_all, *size),
    )


def _one_way(axes: Axes, row: SetupResults, x: float) -> None:
    p50, bound = row.spreads["one_way_p50_ms"].median, row.median("one_way_bound_ms") or 0.0
    # a way is never shorter than nothing, whatever the bound
    below_above = [[min(bound, p50)], [bound]]
    axes.bar(x, p50, width=0.7, color=BAR_COLOUR, yerr=below_above, ecolor="#52606d", capsize=2, linewidth=0)
    p99, true = row.median("one_way_p99_ms"), row.median("true_one_way_p50_ms")
    if p99 is not None:
        axes.plot(x, p99, "_", color=LIMIT_COLOUR, markersize=9, markeredgewidth=1.6)
    if true is not None:
        axes.plot(x, true, "o", color=INK, markersize=4)


def _motion(rows: Sequence[SetupResults]) -> Plot | None:
    """One joint for a few seconds: each strategy over each network, with the first transport."""
    first: dict[tuple[str, str], tuple[Setup, Excerpt]] = {}
    for row in rows:
        found = [c.excerpt for c in row.cells if c.status is CellStatus.DONE and c.excerpt is not None]
        if found:
            first.setdefault((row.setup.profile, row.setup.strategy), (row.setup, found[0]))
    if not first:
        return None
    profiles, strategies = _names(p for p, _ in first), _names(s for _, s in first)

    def draw_all(figure: Figure) -> None:
        grid = figure.subplots(len(profiles), len(strategies), squeeze=False, sharey=True)
        for i, profile in enumerate(profiles):
            for j, strategy in enumerate(strategies):
                axes = grid[i][j]
                shown = first.get((profile, strategy))
                if shown is None:
                    axes.axis("off")
                    continue
                setup, excerpt = shown
                axes.plot(excerpt.at_s, excerpt.operator_deg, color=INK, linewidth=1.0, label="operator")
                axes.plot(excerpt.at_s, excerpt.robot_deg, color=colour(j), linewidth=1.2,
                          label="robot (coloured by strategy)")  # fmt: skip
                axes.set_title(f"{profile}, {setup.transport}, {strategy}", fontsize=8.5, loc="left")
                if j == 0:
                    axes.set_ylabel(f"{excerpt.joint.replace('_', ' ')}, °")
                if i == len(profiles) - 1:
                    axes.set_xlabel("time, s")
        figure.legend(*grid[0][0].get_legend_handles_labels(), loc="outside lower left", ncols=2)

    size = (3.1 * len(strategies) + 0.4, 1.9 * len(profiles) + 0.4)
    return Plot(
        "One joint, operator and robot",
        "The last seconds of a repeat's judged time, in the joint that moved furthest.",
        svg(draw_all, *size),
    )


def _places(axes: Axes, rows: Sequence[SetupResults]) -> list[float]:
    """The x position of each setup: networks apart, the transport below, the network above."""
    places, labels, x, before = [], [], 0.0, None
    for row in rows:
        profile = row.setup.profile
        if profile != before:
            x += 0.8 if before is not None else 0.0
            axes.annotate(
                profile, (x - 0.3, 1.0), xycoords=("data", "axes fraction"), fontsize=8.5, fontweight="bold",
                color="#323f4b", va="bottom",
            )  # fmt: skip
            before = profile
        places.append(x)
        labels.append(row.setup.transport)
        x += 1.0
    axes.set_xticks(places, labels, rotation=60, ha="right", rotation_mode="anchor")
    axes.set_xlim(-0.8, x - 0.2)
    return places


def _legend(axes: Axes, strategies: Sequence[str], profiles: Sequence[str] = ()) -> None:
    for i, strategy in enumerate(strategies):
        axes.plot([], [], "s", color=colour(i), label=strategy)
    for i, profile in enumerate(profiles):
        axes.plot([], [], MARKS[i % len(MARKS)], color="#7b8794", label=profile)
    axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))


def _names(names: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(names))


def _svg(draw: Callable[[Axes], None], width: float = 6.5, height: float = 3.1) -> str:
    return svg(lambda figure: draw(figure.subplots()), width, height)
