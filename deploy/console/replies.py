"""What requests hold and what is answered, as JSON; and whose request it is."""

from __future__ import annotations

import json

from aiohttp import web

from common.clock import monotonic_ns
from deploy.console.acts import ActRefusedError
from deploy.console.hub import as_json
from deploy.console.persons import Persons, common_name_of
from deploy.console.session import Access, Person

COOKIE = "tandem_console"
"""Cookies know no ports: the port is added, or two consoles on one host would log each other out."""
POLICY = (
    "default-src 'self'; img-src 'self' blob:; style-src 'self'; connect-src 'self'; worker-src 'self'; "
    "frame-ancestors 'none'; base-uri 'none'; form-action 'none'; object-src 'none'"
)
HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), geolocation=(), microphone=()",
}


class Visitors:
    """Whose request it is: by the cookie of this console, else by the certificate that the browser shows."""

    def __init__(self, access: Access, port: int, persons: Persons) -> None:
        self._access = access
        self._persons = persons
        self.cookie = f"{COOKIE}_{port}"

    def of(self, request: web.Request) -> tuple[str, Person]:
        """The secret of the log-in, and the person."""
        now_ns = monotonic_ns()
        secret = request.cookies.get(self.cookie, "")
        if not self._access.lives(secret, now_ns) and (shown := _certificate(request)):
            secret = self._persons.secret(
                shown,
                lambda known: self._access.lives(known, now_ns),
                lambda person: self._access.enter(person, now_ns),
            )
        return secret, self._access.person(secret, now_ns)


def _certificate(request: web.Request) -> str:
    """The common name of the certificate that the connection was checked by; empty without one."""
    tls = None if request.transport is None else request.transport.get_extra_info("ssl_object")
    return "" if tls is None else common_name_of(tls.getpeercert())


def parsed(text: str) -> dict[str, object] | None:
    """A JSON object; None where it is none."""
    try:
        body = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return body if isinstance(body, dict) else None


async def body_of(request: web.Request) -> dict[str, object]:
    """A post's JSON object. Raises ActRefusedError."""
    if request.content_type != "application/json":
        raise ActRefusedError(415, "expected Content-Type application/json")
    body = parsed(await request.text())
    if body is None:
        raise ActRefusedError(400, "expected a JSON object")
    return body


def answer(value: object, status: int = 200) -> web.Response:
    """JSON, which no browser keeps."""
    return web.Response(
        text=as_json(value),
        status=status,
        content_type="application/json",
        headers={"Cache-Control": "no-store"},
    )


def error_answer(status: int, words: str) -> web.Response:
    """A refusal, in words."""
    response = answer({"error": words}, status)
    response.headers.update(HEADERS)
    return response
