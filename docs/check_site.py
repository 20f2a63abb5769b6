"""Walk the built site: no dead internal link, nothing fetched from elsewhere, examples to download.

``python docs/check_site.py docs/_build/html`` prints what is wrong and ends with 1.
"""

import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

#: Element -> attribute by which a browser fetches what the page needs.
_FETCHED = {
    "audio": "src",
    "embed": "src",
    "iframe": "src",
    "img": "src",
    "script": "src",
    "source": "src",
    "video": "src",
}
#: Of ``<link>``: those that a browser follows by itself.
_FETCHED_LINKS = {"stylesheet", "preload", "prefetch", "icon", "shortcut", "modulepreload"}
_EXTERNAL = ("http://", "https://", "//")
#: How a style sheet fetches from elsewhere.
_FETCHED_BY_STYLES = ("url(http", "url(//", "@import url(http", '@import "http')

#: Folders of examples, and the files that each of their pages must offer for download.
_EXAMPLES = ("gallery", "traps")
_DOWNLOADS = (".py", ".ipynb")


class Page(HTMLParser):
    """What one page points to.

    Parameters
    ----------
    text : str
        Its HTML.

    Attributes
    ----------
    links : list of str
        Where its anchors lead.
    fetched : list of str
        What a browser loads to show it.
    anchors : set of str
        Places in it that others may lead to.
    """

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.fetched: list[str] = []
        self.anchors: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Take note of an element.

        Parameters
        ----------
        tag : str
            Its name.
        attrs : list of tuple
            Its attributes.
        """
        told = {name: value or "" for name, value in attrs}
        self.anchors |= {told[name] for name in ("id", "name") if name in told}
        if tag == "a" and "href" in told:
            self.links.append(told["href"])
        if tag in _FETCHED and told.get(_FETCHED[tag]):
            self.fetched.append(told[_FETCHED[tag]])
        if tag == "link" and _FETCHED_LINKS & set(told.get("rel", "").split()):
            self.fetched.append(told.get("href", ""))


def problems(site: Path) -> Iterator[str]:
    """Yield what is wrong with a site, a line each.

    Parameters
    ----------
    site : pathlib.Path
        The folder of its ``index.html``.
    """
    site = site.resolve()
    files = sorted(file for file in site.rglob("*.html") if "_static" not in file.parts)
    pages = {file: Page(file.read_text(encoding="utf-8")) for file in files}
    for file in pages:
        for problem in _of_page(file, pages):
            yield f"{file.relative_to(site)}: {problem}"
        if str(file.parent.relative_to(site)) in _EXAMPLES and file.stem != "index":
            for suffix in _missing_downloads(file, pages[file].links):
                yield f"{file.relative_to(site)}: offers no {file.stem}{suffix} for download"
    for file in sorted(site.rglob("*.css")):
        text = file.read_text(encoding="utf-8")
        for start in (start for start in _FETCHED_BY_STYLES if start in text):
            yield f"{file.relative_to(site)}: fetches from elsewhere ({start})"


def _missing_downloads(file: Path, links: list[str]) -> Iterator[str]:
    """Yield suffixes of files that the page of an example should link to and does not."""
    names = {Path(unquote(link)).name for link in links if "_downloads/" in link}
    yield from (suffix for suffix in _DOWNLOADS if file.stem + suffix not in names)


def _of_page(file: Path, pages: dict[Path, Page]) -> Iterator[str]:
    """Yield what is wrong with one page."""
    for target in pages[file].fetched:
        if target.startswith(_EXTERNAL):
            yield f"fetches {target} from elsewhere"
        elif not target.startswith("data:") and (why := _dead(file, target, pages)):
            yield f"needs {target}, {why}"
    for target in pages[file].links:
        inside = not urlsplit(target).scheme and not target.startswith("//")
        if inside and (why := _dead(file, target, pages)):
            yield f"leads to {target}, {why}"


def _dead(file: Path, target: str, pages: dict[Path, Page]) -> str:
    """Return why a target is not there; nothing where it is."""
    parts = urlsplit(target)
    path = unquote(parts.path)
    found = (file.parent / path).resolve() if path else file
    if found.is_dir():
        found = found / "index.html"
    if not found.is_file():
        return "which is not there"
    place = unquote(parts.fragment)
    if place and found in pages and place not in pages[found].anchors:
        return "which has no such place"
    return ""


def main(arguments: list[str]) -> int:
    """Check a site and say what is wrong; return the exit status.

    Parameters
    ----------
    arguments : list of str
        Its folder.
    """
    if len(arguments) != 1 or not (Path(arguments[0]) / "index.html").is_file():
        sys.stderr.write("check_site: expected the folder of a built site, with its index.html\n")
        return 2
    found = list(problems(Path(arguments[0])))
    for problem in found:
        sys.stderr.write(f"{problem}\n")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
