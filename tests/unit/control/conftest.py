"""Profiles of a small analysis, and the published one."""

import pytest
from tests.unit.control.made_study import made_analysis

from jointz.control.make_profile import impedance_profile


@pytest.fixture(scope="session")
def profile():
    return impedance_profile(made_analysis(), "S01")


@pytest.fixture(scope="session")
def published():
    return impedance_profile()
