"""A made-up soak, as the soak's own tests have it."""

from tests.deploy.experiments.soak.conftest import make as make
