"""A person's certificate on the command line: its key and its authority's certificate lie beside it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from deploy.certificates import AUTHORITY

Certificate = Annotated[
    Path | None,
    typer.Option(
        help=f"Your certificate, for tls and quic; its .key and {AUTHORITY}.pem lie beside it.",
        dir_okay=False,
        envvar="TANDEM_CERTIFICATE",
    ),
]


def tls_beside(certificate: Path | None) -> dict[str, dict[str, Path]]:
    """`[link]`'s keys for it; empty where there is none."""
    if certificate is None:
        return {}
    here = certificate.absolute()
    return {
        "tls": {
            "ca": here.with_name(f"{AUTHORITY}.pem"),
            "certificate": here,
            "key": here.with_suffix(".key"),
        }
    }
