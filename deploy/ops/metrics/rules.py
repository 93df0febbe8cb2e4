"""Alerts, and the dashboard, made from the table. `python -m deploy.ops.metrics.rules` writes both."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path

from deploy.ops.metrics.table import RECORDING_AGE, RECORDING_FREE, TABLE, UP

FOLDER = Path(__file__).parent
ALERTS_FILE, DASHBOARD_FILE = FOLDER / "alerts.yaml", FOLDER / "grafana.json"
NAME = re.compile(r"\btandem_[a-z_]+")


@dataclass(frozen=True, slots=True)
class AlertRule:
    """One alert."""

    name: str
    expression: str
    lasting: str
    """How long it must hold."""
    severity: str
    summary: str


ALERTS = (
    AlertRule(
        "TandemSilent", f"{UP} == 0", "10s", "critical",
        "{{ $labels.role }} of {{ $labels.robot }} is silent",
    ),
    AlertRule(
        "TandemMetricsSilent", f"absent({UP})", "30s", "critical", "`tandem metrics` itself is not scraped"
    ),
    AlertRule(
        "TandemRobotSilent", "tandem_robot_silent == 1", "5s", "critical",
        "the master does not hear {{ $labels.robot }}",
    ),
    AlertRule(
        "TandemEmergencyStop", 'tandem_guard_state{state="estop"} == 1', "0s", "critical",
        "{{ $labels.robot }} is in emergency stop",
    ),
    AlertRule(
        "TandemLatencyUntrusted", "tandem_clock_offset_trusted == 0", "30s", "warning",
        "one-way latencies of {{ $labels.robot }} are not known: the clock offset is not",
    ),
    AlertRule(
        "TandemLate",
        "histogram_quantile(0.99, rate(tandem_one_way_seconds_bucket[1m])) > 0.15", "1m", "warning",
        "of the commands to {{ $labels.robot }} in the last minute 1 % came later than 150 ms",
    ),
    AlertRule(
        "TandemHolds", "increase(tandem_holds_total[10m]) > 3", "0s", "warning",
        "{{ $labels.robot }} held more than 3 times in 10 minutes ({{ $labels.lost }})",
    ),
    AlertRule(
        "TandemNodeLost", 'rate(tandem_node_windows_total{event="lost"}[1m]) > 10', "5s", "warning",
        "node {{ $labels.node }} is lost",
    ),
    AlertRule(
        "TandemNodeDoubted", "tandem_node_doubted == 1", "5s", "warning",
        "the readings of node {{ $labels.node }} are not believed",
    ),
    AlertRule(
        "TandemTicksMissed", "rate(tandem_ticks_missed_total[5m]) > 1", "1m", "warning",
        "the host of the {{ $labels.role }} is too slow: more than one tick a second is missed",
    ),
    AlertRule(
        "TandemRecordingFailed", f"{RECORDING_AGE} > 10", "10s", "warning", "nothing was recorded for 10 s"
    ),
    AlertRule(
        "TandemDiskNearlyFull", f"{RECORDING_FREE} < 2e9", "1m", "warning",
        "less than 2 GB are left for recordings",
    ),
)  # fmt: skip


def alerts() -> str:
    """The rules as Prometheus reads them. Each text is JSON, which is YAML too."""
    lines = [
        "# Made by `python -m deploy.ops.metrics.rules` from deploy/ops/metrics/table.py and rules.py.",
        "groups:",
    ]
    lines += ["  - name: tandem", "    rules:"]
    for rule in ALERTS:
        lines += [
            f"      - alert: {rule.name}",
            f"        expr: {json.dumps(rule.expression)}",
            f"        for: {rule.lasting}",
            f"        labels: {{severity: {rule.severity}}}",
            f"        annotations: {{summary: {json.dumps(rule.summary)}}}",
        ]
    return "\n".join(lines) + "\n"


def dashboard() -> str:
    """A Grafana dashboard: a panel for each drawn row of the table, two beside each other."""
    panels = [
        {
            "id": number + 1,
            "type": "timeseries",
            "title": metric.help.rstrip("."),
            "datasource": {"type": "prometheus", "uid": "${datasource}"},
            "gridPos": {"h": 8, "w": 12, "x": 12 * (number % 2), "y": 8 * (number // 2)},
            "fieldConfig": {"defaults": {"unit": metric.unit}, "overrides": []},
            "targets": [
                {
                    "refId": "A",
                    "expr": metric.drawn.format(name=metric.full_name),
                    "legendFormat": " ".join(
                        f"{{{{{label}}}}}" for label in ("robot", "role", *metric.labels)
                    ),
                }
            ],
        }
        for number, metric in enumerate(metric for metric in TABLE if metric.drawn)
    ]
    datasource = {"name": "datasource", "type": "datasource", "query": "prometheus", "label": "Prometheus"}
    tree = {
        "title": "tandem", "uid": "tandem", "schemaVersion": 39, "editable": True,
        "refresh": "5s", "tags": ["tandem"],
        "time": {"from": "now-15m", "to": "now"}, "templating": {"list": [datasource]}, "panels": panels,
    }  # fmt: skip
    return json.dumps(tree, indent=1, ensure_ascii=False) + "\n"


def named_in(text: str) -> frozenset[str]:
    """Every metric of tandem that a text names."""
    return frozenset(NAME.findall(text))


if __name__ == "__main__":
    ALERTS_FILE.write_text(alerts(), "utf-8")
    DASHBOARD_FILE.write_text(dashboard(), "utf-8")
