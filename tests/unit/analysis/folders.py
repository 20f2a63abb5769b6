"""Results folders that tests write, and what is in them."""

import json

from jointz.io.new_folder import ANALYSIS, MARKER, new_folder, write_marker


def names(folder):
    return sorted(p.name for p in folder.iterdir())


def fill(out, text, *, overwrite=False, meanwhile=lambda: None, **more):
    """Write a folder, and do something else before it takes its name."""
    with new_folder(out, marker=MARKER, overwrite=overwrite, **more) as folder:
        write_marker(folder, MARKER, {"made_by": ANALYSIS, "text": text})
        meanwhile()


def text_of(out):
    return json.loads((out / MARKER).read_text())["text"]
