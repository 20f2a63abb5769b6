"""Sphinx: the pages of jointz. Build with ``make docs``; warnings are errors."""

import tomllib
from pathlib import Path

_PROJECT = tomllib.loads((Path(__file__).parent.parent / "pyproject.toml").read_text())["project"]

project = "jointz"
author = "The jointz developers"
copyright = "The jointz developers"
release = version = _PROJECT["version"]

extensions = ["myst_parser"]
exclude_patterns = ["_build", "requirements.txt"]
myst_heading_anchors = 3
nitpicky = True

html_theme = "pydata_sphinx_theme"
html_title = "jointz"
html_theme_options = {
    "navbar_end": ["theme-switcher"],
    "secondary_sidebar_items": ["page-toc"],
    "show_prev_next": False,
}
html_show_sourcelink = False
