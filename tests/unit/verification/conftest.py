"""A study with another text in its ``study.toml``."""

import shutil

import pytest


@pytest.fixture
def changed(study, tmp_path):
    """Return a function that copies the study with another text in its study.toml."""

    def change(old, new):
        copy = tmp_path / "study"
        shutil.copytree(study, copy, ignore=shutil.ignore_patterns("sessions"))
        text = (study / "study.toml").read_text()
        assert old in text
        (copy / "study.toml").write_text(text.replace(old, new))
        return copy

    return change
