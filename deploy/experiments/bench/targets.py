"""The limits that a bench is held to."""

from __future__ import annotations

from deploy.measure.target import Target

BENCH = (
    Target("orientations of 36 nodes", ("pipeline", "nodes_36", "orientation_us", "median"), 200.0, "µs"),
    Target("the same with ekf", ("pipeline", "nodes_36_ekf", "orientation_us", "median"), 400.0, "µs"),
    Target("25 joint angles", ("pipeline", "joint_angles_us", "median"), 150.0, "µs"),
    Target("encode + decode a command", ("pipeline", "codec_us", "median"), 15.0, "µs"),
    Target("put → received / bare Zenoh", ("link", "over_bare_zenoh"), 1.5),
    Target("the same over tcp, p99", ("transports", "tcp_p99_over_bare_zenoh"), 2.0),
    Target("tls, quic, quic-datagram / tcp, the worst", ("transports", "worst_secure_over_tcp"), 2.0),
    Target("master, of one core", ("core_percent", "master_36_nodes"), 35.0, "%"),
)
