import pytest

from .results_folders import estimates, write_folder


@pytest.fixture
def results(tmp_path):
    """Write a results folder and return its path."""

    def write(name, people="ABCDE", *, table=None, provenance=None, seed=0, scale=1.0, **study):
        table = estimates(people, seed=seed, scale=scale) if table is None else table
        return write_folder(tmp_path / name, table, provenance=provenance, **study)

    return write
