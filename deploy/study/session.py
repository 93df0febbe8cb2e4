"""The folder of one session: what it is, its marks, its recordings.

ROOT/sub-03/ses-02/session.json   protocol.toml   marks.jsonl   master.mcap   seal.json
"""

from __future__ import annotations

import json
import platform
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

from common.clock import NS_PER_S, Clock, monotonic_ns, wall_ns
from common.errors import TandemError
from common.wire.version import software
from deploy.study.balanced import balanced_order
from deploy.study.marks import Mark, MarkKind, look_at_marks, read_marks, write_mark
from deploy.study.protocol import ProtocolStep, StudyProtocol, check_code, load_protocol

SESSION, PROTOCOL = "session.json", "protocol.toml"


@dataclass(frozen=True, slots=True)
class SessionHead:
    """`session.json`."""

    subject: str
    """A code, never a name."""
    session: str
    protocol: str
    protocol_version: str
    protocol_sha256: str
    begun: str
    """Time of day, UTC."""
    consent: str
    """Number of the consent form; empty where none is named."""
    scope: tuple[str, ...]
    """What the subject has consented to: `motion`, `video`, `sharing`."""
    tandem: str
    machine: str
    conditions: tuple[str, ...] = ()
    """Codes of the conditions in this session's order, of a blinded protocol."""


class Session:
    """A session's folder."""

    def __init__(self, path: Path) -> None:
        """Raises TandemError where there is no session."""
        self.path = path
        try:
            tree = json.loads((path / SESSION).read_text("utf-8"))
            lists = {key: tuple(tree[key]) for key in ("scope", "conditions") if key in tree}
            self.head = SessionHead(**{**tree, **lists})
            self.protocol: StudyProtocol = load_protocol(path / PROTOCOL)[0]
        except (OSError, ValueError, TypeError, KeyError):
            raise TandemError(f"{path}: there is no session; `tandem session start` makes one") from None

    def metadata(self) -> dict[str, str]:
        """For the head of each recording."""
        plain = {key: value for key, value in asdict(self.head).items() if key not in ("tandem", "machine")}
        return {f"study_{key}": " ".join(v) if isinstance(v, tuple) else str(v) for key, v in plain.items()}

    def may_record(self, topic: str) -> bool:
        """Whether the subject has consented to what a topic holds."""
        return "/video/" not in topic or "video" in self.head.scope

    def mark(self, kind: MarkKind, text: str, wall: Clock = wall_ns, clock: Clock = monotonic_ns) -> Mark:
        """Write a mark down, for whoever records to find. Raises TandemError after the end."""
        if self.ended:
            raise TandemError(f"{self.path}: the session has ended; it takes no more marks")
        return write_mark(self.path, kind, text, wall, clock)

    def marks(self) -> list[Mark]:
        """All, in order. Raises TandemError where a line is none."""
        return read_marks(self.path)

    @property
    def ended(self) -> bool:
        """Whether its end is marked."""
        return any(mark.kind is MarkKind.END for mark in look_at_marks(self.path)[0])

    @property
    def step(self) -> str:
        """The step that is under way; empty before the first."""
        return self._begun()[-1] if self._begun() else ""

    @property
    def steps(self) -> list[ProtocolStep]:
        """The protocol's steps; of a blinded protocol once in each condition, such as `K7-reach`."""
        return [
            step.model_copy(update={"name": f"{code}-{step.name}"})
            for code in self.head.conditions
            for step in self.protocol.step
        ] or self.protocol.step

    @property
    def steps_left(self) -> list[ProtocolStep]:
        """Those that have not begun."""
        begun = self._begun()
        return [step for step in self.steps if step.name not in begun]

    def next_step(self) -> str | None:
        """Begin the next step; its name, None where all are done."""
        left = self.steps_left
        if not left:
            return None
        self.mark(MarkKind.STEP, left[0].name)
        return left[0].name

    def _begun(self) -> list[str]:
        return [mark.text for mark in look_at_marks(self.path)[0] if mark.kind is MarkKind.STEP]


def _order(root: Path, protocol: StudyProtocol, new: Path) -> tuple[str, ...]:
    """The conditions' order: the next row of a balanced square, over all sessions of the study."""
    before = sum(path != new for path in root.glob("sub-*/ses-*"))
    return tuple(balanced_order(sorted(protocol.conditions), before, protocol.commitment))


def expects_signature(folder: Path) -> bool:
    """Whether the protocol of the session in this folder wants its seal signed; False without a session."""
    return (folder / PROTOCOL).exists() and load_protocol(folder / PROTOCOL)[0].signed


def begin(
    root: Path,
    protocol: Path,
    subject: str,
    session: str | None = None,
    consent: str = "",
    scope: Sequence[str] = ("motion",),
    wall: Clock = wall_ns,
) -> Session:
    """Make the folder of a new session; without a code it is numbered. Raises TandemError, ConfigError."""
    check_code("--subject", subject)
    checked, digest = load_protocol(protocol)
    of_subject = root / f"sub-{subject}"
    if session is None:
        session = f"{1 + len(list(of_subject.glob('ses-*'))):02}"
    check_code("--session", session)
    unknown = sorted(set(scope) - {"motion", "video", "sharing"})
    if unknown:
        raise TandemError(f"--scope {unknown[0]}: expected motion, video or sharing")
    path = of_subject / f"ses-{session}"
    try:
        path.mkdir(parents=True)
    except FileExistsError:
        raise TandemError(f"{path}: this session is there already; choose another --session") from None
    except OSError as error:
        raise TandemError(f"{path}: cannot be made ({error.strerror})") from None
    head = SessionHead(
        subject=subject,
        session=session,
        protocol=checked.name,
        protocol_version=checked.version,
        protocol_sha256=digest,
        begun=datetime.fromtimestamp(wall() / NS_PER_S, UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
        consent=consent,
        scope=tuple(scope),
        tandem=software().tandem,
        machine=f"{platform.machine()} {platform.system()}",
        conditions=_order(root, checked, path),
    )
    (path / PROTOCOL).write_bytes(protocol.read_bytes())
    (path / SESSION).write_text(json.dumps(asdict(head), indent=2, ensure_ascii=False) + "\n", "utf-8")
    return Session(path)
