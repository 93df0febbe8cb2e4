"""`tandem keys`: what the certificates hold, and that nothing is overwritten or readable to others."""

from __future__ import annotations

import json
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization.pkcs12 import load_key_and_certificates
from cryptography.x509.oid import ExtendedKeyUsageOID
from typer.testing import CliRunner

from common.errors import LinkError
from common.link.certificates import check_tls
from common.link.config import TlsConfig
from common.link.revoked import RevocationFile
from common.link.roles import Role
from deploy.certificates import KeysError
from deploy.certificates.folder import read_authority, shown, stem, write_pair
from deploy.certificates.make import CLOCKS_APART, Pair, new_authority, new_identity
from deploy.cli import app

NOW = datetime(2030, 1, 1, tzinfo=UTC)
DAY = timedelta(days=1)


@pytest.fixture(name="authority", scope="module")
def an_authority() -> Pair:
    return new_authority("clinic", NOW, 100 * DAY)


def tandem(*arguments: str | Path) -> tuple[str, BaseException | None]:
    result = CliRunner().invoke(app, ["keys", *map(str, arguments)], env={"COLUMNS": "200"})
    return result.output, result.exception


def tls(folder: Path, who: str, ca: str = "ca") -> TlsConfig:
    return TlsConfig(ca=folder / f"{ca}.pem", certificate=folder / f"{who}.pem", key=folder / f"{who}.key")


def test_a_certificate_serves_both_ends_under_its_addresses_and_names(authority: Pair) -> None:
    hosts = ["192.168.7.2", "[::1]", "robot.local"]
    made = new_identity(authority, Role.ROBOT, "robot-1", hosts, NOW, DAY).certificate
    made.verify_directly_issued_by(authority.certificate)
    assert made.subject.rfc4514_string() == "CN=robot:robot-1"
    value = made.extensions.get_extension_for_class
    assert [str(name.value) for name in value(x509.SubjectAlternativeName).value] == [
        "192.168.7.2",
        "::1",
        "robot.local",
    ]
    both = [ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH]
    assert list(value(x509.ExtendedKeyUsage).value) == both
    assert not value(x509.BasicConstraints).value.ca
    assert not value(x509.KeyUsage).value.key_cert_sign
    key = made.public_key()
    assert isinstance(key, ec.EllipticCurvePublicKey)
    assert key.curve.name == "secp256r1"
    assert made.not_valid_before_utc == NOW - CLOCKS_APART
    assert made.not_valid_after_utc == NOW + DAY


def test_it_ends_with_its_authority_and_an_expired_one_makes_none(authority: Pair) -> None:
    made = new_identity(authority, Role.OPERATOR, "anna", [], NOW, 1000 * DAY).certificate
    assert made.not_valid_after_utc == authority.certificate.not_valid_after_utc
    with pytest.raises(ValueError, match="the authority has expired"):
        new_identity(authority, Role.OPERATOR, "anna", [], NOW + 100 * DAY, DAY)


@pytest.mark.parametrize("host", ["", "a b", "tcp/1.2.3.4", "1.2.3.4:7447", "*.local", "rö.local"])
def test_what_is_no_host_is_refused(authority: Pair, host: str) -> None:
    with pytest.raises(ValueError, match="expected an address or a host's name"):
        new_identity(authority, Role.ROBOT, "r", [host], NOW, DAY)


def test_keys_are_for_their_owner_alone_and_never_overwritten(tmp_path: Path, authority: Pair) -> None:
    certificate, key = write_pair(tmp_path / "new", "ca", authority)
    assert key.stat().st_mode & 0o777 == 0o600
    before = key.read_bytes(), certificate.read_bytes()
    with pytest.raises(KeysError, match=r"ca\.pem and .*ca\.key exist already"):
        write_pair(tmp_path / "new", "ca", authority)
    certificate.unlink()
    with pytest.raises(KeysError, match=r"ca\.key exist already"):
        write_pair(tmp_path / "new", "ca", authority)
    assert key.read_bytes() == before[0]
    assert b"BEGIN PRIVATE KEY" in before[0], "PKCS8"


def test_the_commands_make_what_a_host_needs(tmp_path: Path) -> None:
    keys = tmp_path / "keys"
    assert tandem("authority", keys, "--name", "clinic")[1] is None
    said, error = tandem("make", keys, "robot:robot-1", "--host", "127.0.0.1", "--days", "2")
    assert error is None
    assert 'certificate = "robot-robot-1.pem"' in said
    assert "others cannot connect to it" in tandem("make", keys, "operator:anna")[0]
    check_tls(tls(keys, "robot-robot-1"), datetime.now(UTC))
    found = json.loads(tandem("show", keys, "--json")[0])
    assert [(each["common_name"], each["authority"]) for each in found] == [
        ("clinic", True), ("operator:anna", False), ("robot:robot-1", False),
    ]  # fmt: skip
    assert found[2]["hosts"] == ["127.0.0.1"]
    assert 1.9 < found[2]["days_left"] <= 2.0
    assert "robot:robot-1" in tandem("show", keys)[0]


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (("make", "KEYS", "operator:anna"), "no authority in .*: make one with `tandem keys authority"),
        (("make", "KEYS", "nurse:anna"), "expected one of operator:NAME, robot:NAME"),
        (("make", "KEYS", "operator:a/b"), "expected a name of at most 48 letters"),
        (("make", "KEYS", "operator:" + "a" * 49), "expected a name of at most 48 letters"),
        (("make", "KEYS", "operator:zoë"), "expected a name of at most 48 letters"),
        (("make", "KEYS", "operator:.anna"), "expected a name of at most 48 letters"),
        (("authority", "KEYS", "--name", ""), "expected 1 to 64 characters"),
    ],
)
def test_mistakes_say_what_to_do(tmp_path: Path, arguments: tuple[str, ...], why: str) -> None:
    _, error = tandem(*(str(tmp_path / "keys") if a == "KEYS" else a for a in arguments))
    assert isinstance(error, KeysError)
    with pytest.raises(KeysError, match=why):
        raise error


def test_what_has_expired_is_shown_and_ends_with_an_error(tmp_path: Path) -> None:
    old = datetime.now(UTC) - 10 * DAY
    authority = new_authority("old", old, 100 * DAY)
    write_pair(tmp_path, "robot-r", new_identity(authority, Role.ROBOT, "r", [], old, DAY))
    (each,) = shown([tmp_path])
    assert each.days_left(datetime.now(UTC)) < -8
    said, error = tandem("show", tmp_path)
    assert "expired" in said
    assert isinstance(error, KeysError)


def test_an_authority_is_read_back_and_another_s_key_is_noticed(tmp_path: Path, authority: Pair) -> None:
    write_pair(tmp_path, "ca", authority)
    assert read_authority(tmp_path).certificate == authority.certificate
    write_pair(tmp_path / "other", "ca", new_authority("other", NOW, DAY))
    (tmp_path / "ca.key").write_bytes((tmp_path / "other" / "ca.key").read_bytes())
    with pytest.raises(KeysError, match="is not the key of"):
        read_authority(tmp_path)


def test_a_host_s_keys_are_checked_before_anything_is_opened(tmp_path: Path, authority: Pair) -> None:
    write_pair(tmp_path, "ca", authority)
    write_pair(tmp_path, "rogue", new_authority("clinic", NOW, DAY))
    for name in ("a", "b"):
        write_pair(tmp_path, f"robot-{name}", new_identity(authority, Role.ROBOT, name, [], NOW, DAY))
    mine = tls(tmp_path, "robot-a")
    check_tls(mine, NOW)
    (tmp_path / "text.pem").write_text("certificate")

    def refused(config: TlsConfig, why: str, now: datetime = NOW) -> None:
        with pytest.raises(LinkError, match=why):
            check_tls(config, now)

    refused(mine, r"robot-a\.pem expired at 2030-01-02 00:00 UTC", NOW + DAY)
    check_tls(mine, NOW + DAY - timedelta(seconds=1))
    refused(mine, "is not valid before .* is this host's clock right", NOW - CLOCKS_APART - DAY)
    refused(tls(tmp_path, "robot-a", ca="rogue"), "is not from the authority of")
    refused(tls(tmp_path, "robot-c"), r"robot-c\.pem cannot be read \(No such file")
    refused(mine.model_copy(update={"key": tmp_path / "robot-b.key"}), "is not the key of")
    refused(mine.model_copy(update={"key": tmp_path / "text.pem"}), "expected a private key in PEM")
    refused(mine.model_copy(update={"ca": tmp_path / "text.pem"}), "expected a certificate in PEM")


def test_files_are_named_by_role_and_name() -> None:
    assert stem(Role.OPERATOR, "anna") == "operator-anna"


def test_a_name_is_revoked_once_and_gets_no_new_certificate(tmp_path: Path) -> None:
    keys = tmp_path / "keys"
    tandem("authority", keys)
    assert RevocationFile(keys / "revoked.txt").names == frozenset(), "the list that hosts begin with"
    assert tandem("make", keys, "operator:anna")[1] is None
    said, error = tandem("revoke", keys, "operator:anna")
    assert error is None
    assert "operator:anna added" in said
    assert '[link] revoked = "revoked.txt"' in said
    assert "operator:anna is on it already" in tandem("revoke", keys, "operator:anna")[0]
    assert RevocationFile(keys / "revoked.txt").names == {"operator:anna"}
    for suffix in ("pem", "key"):
        (keys / f"operator-anna.{suffix}").unlink()
    error = tandem("make", keys, "operator:anna")[1]
    assert isinstance(error, KeysError)
    assert "operator:anna is revoked in" in str(error)
    assert tandem("make", keys, "operator:anna-2")[1] is None
    assert isinstance(tandem("revoke", keys, "anna")[1], KeysError)
    (keys / "revoked.txt").write_text("nonsense")
    for command in ("revoke", "make"):
        error = tandem(command, keys, "operator:carl")[1]
        assert "line 1: expected role:name" in str(error)


def test_a_person_gets_certificate_and_key_in_one_file_for_the_browser(tmp_path: Path) -> None:
    for command in (("authority", tmp_path), ("make", tmp_path, "operator:nurse-1")):
        assert CliRunner().invoke(app, ["keys", *map(str, command)]).exit_code == 0
    result = CliRunner().invoke(app, ["keys", "browser", str(tmp_path), "operator:nurse-1"])
    assert result.exit_code == 0, result.output
    packed = tmp_path / "operator-nurse-1.p12"
    assert packed.stat().st_mode & 0o777 == 0o600
    password = result.output.replace("\n", "").partition("password ")[2].partition(";")[0].strip()
    _, certificate, _ = load_key_and_certificates(packed.read_bytes(), password.encode())
    assert certificate is not None
    assert "operator:nurse-1" in certificate.subject.rfc4514_string()
    assert CliRunner().invoke(app, ["keys", "browser", str(tmp_path), "operator:nurse-1"]).exit_code
    assert CliRunner().invoke(app, ["keys", "browser", str(tmp_path), "operator:none"]).exit_code
