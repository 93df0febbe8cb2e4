"""The tree is parsed once for all tests of the architecture."""

import pytest

from tests.architecture.imports import SourceTree


@pytest.fixture(scope="session")
def tree() -> SourceTree:
    """The import graph of this project."""
    return SourceTree()
