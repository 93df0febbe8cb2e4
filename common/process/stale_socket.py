"""The Unix socket that a killed process left behind."""

from __future__ import annotations

import socket
from pathlib import Path

from common.errors import TandemError


def remove_stale(
    path: Path, kind: socket.SocketKind, key: str, wrong: type[TandemError] = TandemError
) -> None:
    """Remove a socket of this kind at which nobody listens, so that the path can be bound again.

    `key`: the section and key of the configuration that names the path, such as `[tap] socket`.
    Raises `wrong` where a process listens at the path, or where another kind of file lies there.
    """
    if not path.is_socket():
        if path.exists():
            raise wrong(f"{path}: a file lies there that is no socket; name another {key}")
        return
    with socket.socket(socket.AF_UNIX, kind) as trial:
        try:
            trial.connect(str(path))
        except ConnectionRefusedError:
            path.unlink()
        except OSError:
            return
        else:
            raise wrong(f"{path}: another process listens there; name another {key}")
