"""Descriptions in an XDF file: trees of XML, and metadata by dotted names."""

import re
from collections.abc import Iterator, Mapping
from typing import Any
from xml.etree import ElementTree

Tree = dict[str, list[Any]]

_TAG = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*")
_INDEX = re.compile(r"[2-9]|[1-9]\d{1,3}")


def flat(tree: Any, prefix: str = "") -> dict[str, str]:
    """Return the texts of a tree; the second of two siblings of one name is ``name.2``."""
    texts: dict[str, str] = {}
    for tag, nodes in tree.items():
        for i, node in enumerate(nodes, start=1):
            name = f"{prefix}{tag}" + (f".{i}" if i > 1 else "")
            if isinstance(node, Mapping):
                texts |= flat(node, f"{name}.")
            elif node is not None and str(node) and str(node).strip():
                texts[name] = str(node)
    return texts


def grown(texts: Mapping[str, str]) -> tuple[Tree, list[str]]:
    """Return the tree that :func:`flat` makes these texts of, and the names that fit no tree."""
    tree: Tree = {}
    for name, text in texts.items():
        steps = list(_steps(name))
        if steps and _xml_holds(text):
            _set(tree, steps, text)
    back = flat(tree)
    return tree, [name for name in texts if back.get(name) != texts[name]]


def xml_bytes(tree: Tree) -> bytes:
    """Return a tree under ``<info>``."""
    root = ElementTree.Element("info")
    _fill(root, tree)
    text: bytes = ElementTree.tostring(root, encoding="utf-8")
    return b'<?xml version="1.0"?>' + text


def holdable(text: str) -> str:
    """Return a text without what XML cannot hold."""
    kept = "".join(letter for letter in text if _xml_holds(letter) or letter in " \t\n")
    return kept if kept.strip() else ""


def _steps(name: str) -> Iterator[tuple[str, int]]:
    """Yield tag and number of each step down the tree; nothing where the name is no way."""
    parts, steps = name.split("."), []
    while parts:
        tag, index = parts.pop(0), 1
        if not _TAG.fullmatch(tag):
            return
        if parts and _INDEX.fullmatch(parts[0]):
            index = int(parts.pop(0))
        steps.append((tag, index))
    yield from steps


def _set(tree: Tree, steps: list[tuple[str, int]], text: str) -> None:
    """Put a text where the steps lead; what stands in the way stays."""
    *way, (last, number) = steps
    for tag, index in way:
        node = _sibling(tree, tag, index)
        if node[index - 1] is None:
            node[index - 1] = {}
        if not isinstance(node[index - 1], dict):
            return
        tree = node[index - 1]
    place = _sibling(tree, last, number)
    if place[number - 1] is None:
        place[number - 1] = text


def _sibling(tree: Tree, tag: str, index: int) -> list[Any]:
    nodes = tree.setdefault(tag, [])
    nodes.extend([None] * (index - len(nodes)))
    return nodes


def _fill(element: ElementTree.Element, tree: Tree) -> None:
    for tag, nodes in tree.items():
        for node in nodes:
            child = ElementTree.SubElement(element, tag)
            if isinstance(node, dict):
                _fill(child, node)
            else:
                child.text = node


def _xml_holds(text: str) -> bool:
    """Whether a text comes back out of XML as it went in."""
    element = ElementTree.Element("text")
    element.text = text
    try:
        return ElementTree.fromstring(ElementTree.tostring(element)).text == text
    except (ElementTree.ParseError, UnicodeEncodeError):
        return False
