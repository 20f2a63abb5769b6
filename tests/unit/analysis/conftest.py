"""Analyses by the method bayesian, for all tests of this folder."""

import pytest
from tests.unit.analysis.studies import bayesian_analysis


@pytest.fixture(scope="session")
def recommended():
    return bayesian_analysis()
