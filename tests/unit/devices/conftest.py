"""CI tests the drivers on the real libraries: there a library that is absent is a failure."""

import os

import pytest

_REQUIRED = "JOINTZ_REQUIRE_OSL"


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    """Fail a test that would skip because a library is not installed, where they are required."""
    report = yield
    if os.environ.get(_REQUIRED) and report.skipped and "is not installed" in str(report.longrepr):
        report.longrepr = f"{_REQUIRED} is set, and {report.longrepr[-1]}"
        report.outcome = "failed"
    return report
