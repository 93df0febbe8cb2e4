"""`tandem audit`: which packages run here (a bill of materials), and whether one is known as vulnerable."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import json
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from common.errors import TandemError
from common.process.extras import missing_extra
from deploy.report.output import in_a_folder

SPEC_VERSION = "1.6"
OWN = "tandem"
"""Not asked about: another project of this name may be in the database."""
_LAST_WORDS = 300


@dataclass(frozen=True, slots=True)
class Vulnerability:
    """One that is known of an installed package."""

    package: str
    version: str
    id: str
    fixed_in: tuple[str, ...]

    @property
    def words(self) -> str:
        """For a person."""
        fix = f"fixed in {', '.join(self.fixed_in)}" if self.fixed_in else "no version fixes it yet"
        return f"{self.package} {self.version}: {self.id}, {fix}"


def audit(
    sbom: Annotated[
        Path,
        typer.Option(help="Write the bill of materials here, CycloneDX as JSON.", callback=in_a_folder),
    ] = Path("tandem.cdx.json"),
    sbom_only: Annotated[
        bool, typer.Option("--sbom-only", help="Do not ask the database of vulnerabilities.")
    ] = False,
) -> None:
    """List all installed packages in a file, and ask whether any has a known vulnerability.

    The second part needs the network. It ends with status 1 if one is known, or if that could not be judged.

    Example: `tandem audit --sbom /var/lib/tandem/tandem.cdx.json`
    """
    _need("cyclonedx_py")
    count = write_sbom(sbom)
    typer.echo(f"{sbom}: {count} packages (CycloneDX {SPEC_VERSION})")
    if sbom_only:
        return
    _need("pip_audit")
    found, skipped = ask(installed())
    for one in found:
        typer.echo(one.words)
    if skipped:
        typer.echo(f"not judged: {'; '.join(skipped)}")
    if found or skipped:
        raise TandemError(f"{len(found)} known vulnerabilities, {len(skipped)} packages not judged")
    typer.echo("no known vulnerability")


def write_sbom(path: Path) -> int:
    """Write the bill of materials of this Python environment; the number of packages. Raises TandemError."""
    command = ["cyclonedx_py", "environment", sys.executable, "--sv", SPEC_VERSION, "--of", "JSON"]
    # its own validation takes ten seconds for a hundred packages' addresses; a test does it
    done = _run([*command, "--output-reproducible", "--no-validate", "-o", str(path)])
    if done.returncode:
        raise TandemError(f"{path}: no bill of materials was written: {_last(done.stderr)}")
    return len(json.loads(path.read_text("utf-8")).get("components", ()))


def installed() -> list[str]:
    """All packages but tandem itself, as `name==version`."""
    found = {d.metadata["Name"]: d.version for d in importlib.metadata.distributions()}
    return sorted(f"{name}=={version}" for name, version in found.items() if name.lower() != OWN)


def ask(packages: list[str]) -> tuple[list[Vulnerability], list[str]]:
    """Known vulnerabilities, and packages that could not be judged with the reason. Raises TandemError."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "requirements.txt"
        file.write_text("\n".join(packages) + "\n", "utf-8")
        command = ["pip_audit", "-r", str(file), "--disable-pip", "--no-deps"]
        done = _run([*command, "--format", "json", "--progress-spinner", "off"])
    return read_answer(done.stdout, done.stderr)


def read_answer(said: str, complained: str) -> tuple[list[Vulnerability], list[str]]:
    """What pip-audit said. Raises TandemError where it has not judged: nothing known is not the same."""
    try:
        rows = json.loads(said)["dependencies"]
        skipped = [f"{row['name']} ({row['skip_reason']})" for row in rows if "skip_reason" in row]
        found = [
            Vulnerability(row["name"], row["version"], one["id"], tuple(one["fix_versions"]))
            for row in rows
            for one in row.get("vulns", ())
        ]
    except (ValueError, KeyError, TypeError):
        raise TandemError(
            "vulnerabilities are not judged: the database was not reached or did not answer "
            f"({_last(complained)}); run this where the network reaches it"
        ) from None
    return found, skipped


def _run(module: list[str]) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", *module]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def _need(module: str) -> None:
    if importlib.util.find_spec(module) is None:
        missing = ModuleNotFoundError(f"No module named {module!r}", name=module)
        raise TandemError(missing_extra(missing) or str(missing))


def _last(text: str) -> str:
    lines = text.strip().splitlines() or ["it said nothing"]
    return lines[-1][:_LAST_WORDS]
