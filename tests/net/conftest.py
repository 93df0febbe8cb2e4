"""Hosts of network namespaces; every test skips with the reason where this process may not make them."""

from __future__ import annotations

from pathlib import Path

import pytest

from deploy.sim.network.namespaces import why_not

HERE = Path(__file__).parent


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """All tests of this folder."""
    reason = why_not()
    for item in items:
        if HERE in item.path.parents:
            item.add_marker(pytest.mark.net)
            if reason is not None:
                item.add_marker(pytest.mark.skip(reason=reason))
