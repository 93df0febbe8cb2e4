"""A made-up soak, as the soak's own tests have it."""

from tests.deploy.soak.conftest import make as make
