"""The limits that a bench is held to."""

from __future__ import annotations

from deploy.measure.target import ReportTarget

BENCH = (
    ReportTarget(
        "orientations of 36 nodes", ("pipeline", "nodes_36", "orientation_us", "median"), 200.0, "µs"
    ),
    ReportTarget("the same with ekf", ("pipeline", "nodes_36_ekf", "orientation_us", "median"), 400.0, "µs"),
    ReportTarget("25 joint angles", ("pipeline", "joint_angles_us", "median"), 150.0, "µs"),
    ReportTarget("encode + decode a command", ("pipeline", "codec_us", "median"), 15.0, "µs"),
    ReportTarget("put → received / bare Zenoh", ("link", "over_bare_zenoh"), 1.5),
    ReportTarget("the same over tcp, p99", ("transports", "tcp_p99_over_bare_zenoh"), 2.0),
    ReportTarget("tls, quic, quic-datagram / tcp, the worst", ("transports", "worst_secure_over_tcp"), 2.0),
    ReportTarget("master, of one core", ("core_percent", "master_36_nodes"), 35.0, "%"),
)
