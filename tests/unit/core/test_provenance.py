"""Where a result came from."""

import json
import platform
from importlib.metadata import PackageNotFoundError, version

from jointz.core import provenance


def test_software_names_the_versions_a_number_depends_on():
    told = provenance.software()

    assert told["jointz"] == version("jointz")
    assert told["python"] == platform.python_version()
    assert told["packages"]["numpy"] == version("numpy")
    assert {"numpy", "scipy", "pandas", "xarray", "numba"} <= set(told["packages"])
    assert json.loads(json.dumps(told)) == told


def test_a_package_that_is_absent_is_said_to_be(monkeypatch):
    def absent(package: str) -> str:
        if package == "numba":
            raise PackageNotFoundError(package)
        return "1.0"

    monkeypatch.setattr(provenance, "version", absent)

    packages = provenance.software()["packages"]

    assert packages["numba"] == "not installed"
    assert packages["numpy"] == "1.0"
