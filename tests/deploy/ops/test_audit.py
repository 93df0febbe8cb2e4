"""The bill of materials is one by its own schema; what is not judged is never called well."""

from __future__ import annotations

import importlib.metadata
import json
from pathlib import Path

import pytest

from common.errors import TandemError
from deploy.ops import audit as room
from deploy.ops.audit import Vulnerability, audit, installed, read_answer, write_sbom

VULNERABLE = {
    "dependencies": [
        {"name": "numpy", "version": "2.0.0", "vulns": []},
        {"name": "jinja2", "version": "3.0", "vulns": [{"id": "PYSEC-1", "fix_versions": ["3.1.6"]}]},
        {"name": "own", "skip_reason": "not in the database"},
    ]
}


@pytest.mark.long
def test_the_bill_of_materials_keeps_its_schema_and_names_what_runs_here(tmp_path: Path) -> None:
    # here: at each start of pytest it would compile grammars for 2 s
    from cyclonedx.schema import SchemaVersion
    from cyclonedx.validation.json import JsonStrictValidator

    file = tmp_path / "sbom.json"
    count = write_sbom(file)
    tree = json.loads(file.read_text("utf-8"))
    components = {one["name"].lower(): one["version"] for one in tree["components"]}
    for one in tree["components"][3:]:
        one.pop("externalReferences", None)  # each address takes the validator a tenth of a second
    validator = JsonStrictValidator(SchemaVersion.V1_6)
    assert validator.validate_str(json.dumps(tree)) is None
    tree["components"][0]["type"] = "no such type"
    assert validator.validate_str(json.dumps(tree)) is not None
    assert len(components) == count
    for name in ("numpy", "eclipse-zenoh", "mujoco"):
        assert components[name] == importlib.metadata.version(name)


def test_a_bill_that_cannot_be_written_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(TandemError, match="no bill of materials was written"):
        write_sbom(tmp_path / "no such folder" / "sbom.json")


def test_without_a_network_it_says_so_and_the_bill_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("HTTP_PROXY", "HTTPS_PROXY", "http_proxy", "https_proxy"):
        monkeypatch.setenv(name, "http://127.0.0.1:9")  # nobody listens there
    monkeypatch.setattr(room, "installed", lambda: ["numpy==2.0.0"])
    file = tmp_path / "sbom.json"
    with pytest.raises(TandemError, match="vulnerabilities are not judged"):
        audit(file)
    assert json.loads(file.read_text("utf-8"))["bomFormat"] == "CycloneDX"
    assert "no known vulnerability" not in capsys.readouterr().out


def test_a_known_vulnerability_and_a_package_that_was_skipped_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    found = read_answer(json.dumps(VULNERABLE), "")
    assert found == ([Vulnerability("jinja2", "3.0", "PYSEC-1", ("3.1.6",))], ["own (not in the database)"])
    monkeypatch.setattr(room, "ask", lambda _: found)
    with pytest.raises(TandemError, match="1 known vulnerabilities, 1 packages not judged"):
        audit(tmp_path / "sbom.json")
    said = capsys.readouterr().out
    assert "jinja2 3.0: PYSEC-1, fixed in 3.1.6" in said
    assert "not judged: own" in said


@pytest.mark.parametrize("said", ["", "[]", '{"dependencies": [{"vulns": [{}]}]}'])
def test_an_answer_that_is_none_judges_nothing(said: str) -> None:
    with pytest.raises(TandemError, match=r"not judged.*last words"):
        read_answer(said, "first words\nlast words")


def test_all_packages_but_tandem_itself_are_asked_about() -> None:
    packages = installed()
    assert f"numpy=={importlib.metadata.version('numpy')}" in packages
    assert not any(package.startswith("tandem==") for package in packages)


def test_a_missing_tool_is_named_with_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    with pytest.raises(TandemError, match=r"pip install 'tandem\[audit\]'"):
        audit()
