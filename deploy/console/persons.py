"""Who a person is by the certificate that the browser shows: an alternative to the token. Pure."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from common.link.roles import Role, role_of
from deploy.console.session import PageRole, Person

Enter = Callable[[Person], str]
"""Begins a session; its secret."""


class Persons:
    """Certificates of this console's authority, and the sessions that they have here."""

    def __init__(self, named: Mapping[str, str], operator: str) -> None:
        """`named`: the page's role by common name (`[console] persons`); the operator's own needs none."""
        self._roles = {name: PageRole(role) for name, role in named.items()}
        if operator:
            self._roles.setdefault(f"{Role.OPERATOR}:{operator}", PageRole.OPERATOR)
        self._secrets: dict[str, str] = {}
        self.revoked: frozenset[str] = frozenset()

    def of(self, common_name: str) -> Person | None:
        """Whom the page takes the holder for; None where the certificate means nothing here."""
        role = self._roles.get(common_name)
        if role is None or common_name in self.revoked:
            return None
        try:
            return Person(role, role_of(common_name)[1])
        except ValueError:
            return Person(role, common_name)

    def secret(self, common_name: str, lives: Callable[[str], bool], enter: Enter) -> str:
        """The secret of the holder's session, a new one where there is none; empty where it may not be."""
        person = self.of(common_name)
        if person is None:
            return ""
        secret = self._secrets.get(common_name, "")
        if not secret or not lives(secret):
            secret = self._secrets[common_name] = enter(person)
        return secret

    def revoke(self, names: frozenset[str]) -> list[str]:
        """Names of the certificates that are revoked now; the secrets of sessions that end by it."""
        self.revoked = names
        return [self._secrets.pop(name) for name in list(self._secrets) if name in names]


def common_name_of(peer: Mapping[str, object] | None) -> str:
    """The common name in what Python's ssl tells of a checked certificate; empty where there is none."""
    subject = (peer or {}).get("subject", ())
    assert isinstance(subject, tuple)
    for group in subject:
        for key, value in group:
            if key == "commonName":
                return str(value)
    return ""
