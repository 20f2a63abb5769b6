"""Sphinx: the pages of jointz. Build with ``make docs``; warnings are errors."""

import os
import sys
import tomllib
import warnings
from pathlib import Path
from typing import Any

from pygments.lexers.special import TextLexer

# Scripts of the gallery are short: threads of linear algebra would only wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
warnings.simplefilter("error", FutureWarning)

_HERE = Path(__file__).parent
_PROJECT = tomllib.loads((_HERE.parent / "pyproject.toml").read_text())["project"]
sys.path.insert(0, str(_HERE))

project = "jointz"
author = "The jointz developers"
copyright = "The jointz developers"
release = version = _PROJECT["version"]

extensions = [
    "myst_parser",
    "numpydoc",
    "offline_math",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["_build", "requirements.txt", "gallery/*.ipynb", "traps/*.ipynb"]
myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 3
nitpicky = True
# Docstrings name what is not for everybody, too, and constants: they stand as code, without a
# page of their own. Names of other projects would need their inventories, and so the network.
nitpick_ignore_regex = [
    ("py:.*", r"jointz\..*"),
    ("py:data", r"[A-Z_]+"),
    ("py:.*", r"(collections|functools|numpy|pandas|pathlib|xarray)\..*"),
    ("py:func", "task_key|write_recording"),
    ("py:class", "BenchFit|FullRecordFit|PulseFit"),
]
html_math_renderer = "mathml"

# Types stand in the docstrings, in words and units.
autodoc_typehints = "none"
autodoc_preserve_defaults = True
autosummary_generate = True
templates_path = ["_templates"]
numpydoc_show_class_members = False
numpydoc_xref_param_type = False


sphinx_gallery_conf = {
    "examples_dirs": ["../examples/gallery", "../examples/traps"],
    "gallery_dirs": ["gallery", "traps"],
    "filename_pattern": r"\.py$",
    "ignore_pattern": r"__init__\.py",
    "copyfile_regex": "",
    "within_subsection_order": "gallery_figures.AsListed",
    "backreferences_dir": "api/used",
    "doc_module": ("jointz",),
    "reset_modules": ("gallery_figures.begin",),
    "capture_repr": ("_repr_html_",),
    "abort_on_example_error": False,
    "only_warn_on_example_error": True,  # and a warning is an error
    "download_all_examples": False,
    "remove_config_comments": True,
    "show_memory": False,
    "show_signature": False,
    "min_reported_time": 0.0,
    "write_computation_times": False,
    "matplotlib_animations": False,
    "plot_gallery": "True",
}

html_theme = "pydata_sphinx_theme"
html_title = "jointz"
html_static_path = ["_static"]
html_css_files = ["jointz.css"]
html_theme_options = {
    "navbar_end": ["theme-switcher"],
    "secondary_sidebar_items": ["page-toc"],
    "show_prev_next": False,
    "header_links_before_dropdown": 6,
}
html_show_sourcelink = False


def setup(app: Any) -> None:
    """Show blocks marked ``csv``, which Pygments does not know, as they are."""
    app.add_lexer("csv", TextLexer)
