"""Files as other programs write them, made after the public descriptions of their formats."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore
from scipy.io import savemat

from common.quaternion import Array, conjugate, from_rotation_vector, multiply, rotate, to_matrix
from common.recording.sweeps import write_sweeps

G = 9.80665
RATE_HZ = 100.0


@dataclass(frozen=True, slots=True)
class Session:
    """What one unit measured, and how it was turned; T samples."""

    time_s: Array
    acc: Array
    gyr: Array
    mag: Array
    q: Array

    def node(self, quantities: str = "acc gyr mag quat") -> dict[str, Array]:
        """What a reader should find, by quantity."""
        have = {"acc": self.acc, "gyr": self.gyr, "mag": self.mag, "quat": self.q, "position": self.acc}
        return {name: have[name] for name in quantities.split()}


def session(seconds: float = 20.0, start_s: float = 0.0) -> Session:
    """A unit that is turned about all its axes, then rests: its gyroscope and gravity agree."""
    count = round(seconds * RATE_HZ)
    t = np.arange(count) / RATE_HZ
    gyr = np.stack([1.2 * np.sin(0.7 * t), 0.9 * np.sin(1.1 * t + 1.0), 0.7 * np.cos(0.5 * t)], axis=-1)
    gyr *= (t < 0.8 * seconds)[:, None]
    q = np.empty((count, 4))
    q[0] = [1.0, 0.0, 0.0, 0.0]
    for k in range(1, count):
        q[k] = multiply(q[k - 1], from_rotation_vector(0.5 * (gyr[k - 1] + gyr[k]) / RATE_HZ))
    acc = rotate(conjugate(q), np.array([0.0, 0.0, G]))
    mag = rotate(conjugate(q), np.array([0.0, 20.0, -40.0]))
    return Session(start_s + t, acc, gyr, mag, q)


def line(values: Array, separator: str = ",") -> str:
    return separator.join(f"{value:.15g}" for value in values)


def table(path: Path, names: str, rows: Array, separator: str = ",", prelude: str = "") -> Path:
    path.write_text(prelude + names + "\n" + "".join(line(row, separator) + "\n" for row in rows), "utf-8")
    return path


def csv(folder: Path, s: Session) -> Path:
    names = "time_s," + ",".join(
        f"{q}_{a}_{u}" for q, u in (("acc", "m_s2"), ("gyr", "rad_s")) for a in "xyz"
    )
    names += ",mag_x,mag_y,mag_z,qw,qx,qy,qz"
    return table(folder / "unit.csv", names, np.column_stack([s.time_s, s.acc, s.gyr, s.mag, s.q]))


def xsens_txt(folder: Path, s: Session) -> Path:
    fine = 4294967000 + np.round(1e4 * s.time_s)
    packet = (65500 + np.arange(len(s.time_s))) % 65536
    r = to_matrix(s.q)
    matrix = np.stack([r[:, i, j] for j in range(3) for i in range(3)], axis=-1)
    names = [
        "PacketCounter",
        "SampleTimeFine",
        "Acc_X",
        "Acc_Y",
        "Acc_Z",
        "Gyr_X",
        "Gyr_Y",
        "Gyr_Z",
        "Mag_X",
        "Mag_Y",
        "Mag_Z",
    ]
    names += [f"Mat[{i}][{j}]" for j in (1, 2, 3) for i in (1, 2, 3)]
    prelude = "// Start Time: Unknown\n// Update Rate: 100.0Hz\n// Filter Profile: human (46.1)\n"
    rows = np.column_stack([packet, fine % 2**32, s.acc, s.gyr, s.mag, matrix])
    return table(folder / "MT_00B42D.txt", "\t".join(names), rows, "\t", prelude)


def mvnx(folder: Path, s: Session) -> Path:
    path = folder / "walk.mvnx"
    frames = "".join(
        f'<frame time="{1000 * t:.15g}" index="{k}" type="normal">'
        f"<sensorAcceleration>{line(a, ' ')}</sensorAcceleration>"
        f"<sensorAngularVelocity>{line(w, ' ')}</sensorAngularVelocity>"
        f"<sensorMagneticField>{line(m, ' ')}</sensorMagneticField>"
        f"<sensorOrientation>{line(q, ' ')}</sensorOrientation></frame>\n"
        for k, (t, a, w, m, q) in enumerate(zip(s.time_s, s.acc, s.gyr, s.mag, s.q, strict=True))
    )
    path.write_text(
        '<?xml version="1.0" encoding="UTF-8"?>\n<mvnx version="4" xmlns="http://www.xsens.com/mvn/mvnx">\n'
        '<subject label="P1" frameRate="100" segmentCount="1">\n<segments>'
        '<segment label="RightLowerArm" id="1"/></segments><sensors><sensor label="RightLowerArm"/></sensors>'
        '<frames segmentCount="1" sensorCount="1">\n'
        f'<frame time="0" index="" type="identity"/>\n{frames}</frames></subject></mvnx>\n',
        "utf-8",
    )
    return path


def ximu3(folder: Path, s: Session) -> Path:
    out = folder / "x-IMU3 0123-4567"
    out.mkdir()
    us = 1e6 * s.time_s
    gyr, acc = np.degrees(s.gyr), s.acc / G
    names = ["Timestamp (us)"]
    names += [f"Gyroscope {a} (deg/s)" for a in "XYZ"] + [f"Accelerometer {a} (g)" for a in "XYZ"]
    table(out / "Inertial.csv", ",".join(names), np.column_stack([us, gyr, acc]))
    names = ["Timestamp (us)"] + [f"Magnetometer {a} (a.u.)" for a in "XYZ"]
    table(out / "Magnetometer.csv", ",".join(names), np.column_stack([us, s.mag]))
    table(
        out / "Quaternion.csv",
        "Timestamp (us),W,X,Y,Z".replace("W,X,Y,Z", "Quaternion W,Quaternion X,Quaternion Y,Quaternion Z"),
        np.column_stack([us, s.q]),
    )
    return out


def sto(folder: Path, s: Session) -> Path:
    path = folder / "orientations.sto"
    rows = "".join(f"{t:.6f}\t{line(q)}\n" for t, q in zip(s.time_s, s.q, strict=True))
    path.write_text(
        "DataRate=100.000000\nDataType=Quaternion\nversion=3\nOpenSimVersion=4.4\nendheader\n"
        f"time\ttorso_imu\n{rows}",
        "utf-8",
    )
    return path


def trc(folder: Path, s: Session) -> Path:
    path = folder / "markers.trc"
    rows = "".join(
        f"{k + 1}\t{t:.6f}\t{line(1000.0 * p, chr(9))}\t\n"
        for k, (t, p) in enumerate(zip(s.time_s, s.acc, strict=True))
    )
    path.write_text(
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\t"
        f"OrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n100\t100\t{len(s.time_s)}\t1\tmm\t100\t1\t"
        f"{len(s.time_s)}\nFrame#\tTime\tR.ASIS\t\t\t\n\t\tX1\tY1\tZ1\t\n\n{rows}",
        "utf-8",
    )
    return path


def mat(folder: Path, s: Session) -> Path:
    path = folder / "trial.mat"
    savemat(
        path,
        {"imu_acc": s.acc, "imu_gyr": s.gyr, "imu_mag": s.mag, "opt_quat": s.q, "sampling_rate": RATE_HZ},
    )
    return path


def npz(folder: Path, s: Session) -> Path:
    path = folder / "unit.npz"
    np.savez(path, acc=s.acc, gyr=s.gyr, mag=s.mag, quat=s.q, rate_hz=np.array(RATE_HZ))
    return path


def suit(folder: Path, s: Session) -> Path:
    path = folder / "suit.mcap"
    write_sweeps(path, "nursing", ["head"], RATE_HZ, np.concatenate([s.acc, s.gyr, s.mag], axis=1)[:, None])
    return path


IMU_TOPIC, MAG_TOPIC = "/left_hand/imu/data", "/left_hand/imu/mag"


def messages(s: Session, store: Stores) -> tuple[object, list[tuple[str, str, int, object]]]:
    """The type store, and topic, type, time and message of every sample."""
    types = get_typestore(store)
    t = types.types
    vector, quaternion = t["geometry_msgs/msg/Vector3"], t["geometry_msgs/msg/Quaternion"]
    stamp_of, header_of = t["builtin_interfaces/msg/Time"], t["std_msgs/msg/Header"]
    unknown = np.zeros(9)
    out: list[tuple[str, str, int, object]] = []
    for k, (time, a, w, m, q) in enumerate(zip(s.time_s, s.acc, s.gyr, s.mag, s.q, strict=True)):
        ns = round(1e9 * time)
        head = {"seq": k} if store is Stores.ROS1_NOETIC else {}
        header = header_of(stamp=stamp_of(sec=ns // 10**9, nanosec=ns % 10**9), frame_id="left_hand", **head)
        imu = t["sensor_msgs/msg/Imu"](
            header=header, orientation=quaternion(*q[1:], q[0]), orientation_covariance=unknown,
            angular_velocity=vector(*w), angular_velocity_covariance=unknown,
            linear_acceleration=vector(*a), linear_acceleration_covariance=unknown,
        )  # fmt: skip
        field = t["sensor_msgs/msg/MagneticField"](
            header=header, magnetic_field=vector(*(1e-6 * m)), magnetic_field_covariance=unknown
        )
        out += [
            (IMU_TOPIC, "sensor_msgs/msg/Imu", ns, imu),
            (MAG_TOPIC, "sensor_msgs/msg/MagneticField", ns, field),
        ]
    return types, out


def _bag2(path: Path, s: Session, plugin: StoragePlugin) -> Path:
    types, rows = messages(s, Stores.ROS2_JAZZY)
    with Writer2(path, version=9, storage_plugin=plugin) as writer:
        connections: dict[str, object] = {}
        for topic, kind, ns, message in rows:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=types)  # type: ignore[arg-type]
            writer.write(connections[topic], ns, types.serialize_cdr(message, kind))  # type: ignore[attr-defined, arg-type]
    return path


def bag2(folder: Path, s: Session) -> Path:
    return _bag2(folder / "session", s, StoragePlugin.SQLITE3)


def bag2_mcap(folder: Path, s: Session) -> Path:
    """The one file of a bag, without its folder."""
    return next(_bag2(folder / "session_mcap", s, StoragePlugin.MCAP).glob("*.mcap"))


def bag1(folder: Path, s: Session) -> Path:
    types, rows = messages(s, Stores.ROS1_NOETIC)
    path = folder / "session.bag"
    with Writer1(path) as writer:
        connections: dict[str, object] = {}
        for topic, kind, ns, message in rows:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=types)  # type: ignore[arg-type]
            writer.write(connections[topic], ns, types.serialize_ros1(message, kind))  # type: ignore[attr-defined, arg-type]
    return path


def foreign_mcap(folder: Path) -> Path:
    """An MCAP of somebody else, without sensors."""
    path = folder / "other.mcap"
    with path.open("wb") as stream:
        writer = McapWriter(stream)
        writer.start()
        schema = writer.register_schema("thing", "jsonschema", b"{}")
        channel = writer.register_channel("/thing", "json", schema)
        writer.add_message(channel, 1, b"{}", 1)
        writer.finish()
    return path


Maker = Callable[[Path, Session], Path]
MAKERS: Mapping[str, tuple[Maker, str]] = {
    "csv": (csv, "acc gyr mag quat"),
    "xsens_txt": (xsens_txt, "acc gyr mag quat"),
    "mvnx": (mvnx, "acc gyr mag quat"),
    "ximu3": (ximu3, "acc gyr mag quat"),
    "sto": (sto, "quat"),
    "trc": (trc, "position"),
    "mat": (mat, "acc gyr mag quat"),
    "npz": (npz, "acc gyr mag quat"),
    "suit": (suit, "acc gyr mag"),
    "bag1": (bag1, "acc gyr mag quat"),
    "bag2": (bag2, "acc gyr mag quat"),
    "bag2_mcap": (bag2_mcap, "acc gyr mag quat"),
}
"""By name: what makes the file, and what is to be read from it."""
