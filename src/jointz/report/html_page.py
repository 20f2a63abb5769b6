"""Pages that need no other file: a template filled in, with figures and styles inside."""

import re
from collections.abc import Iterable
from functools import cache
from typing import Any, Final

from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape
from markupsafe import Markup

from jointz.core.channels import pretty_unit
from jointz.report.wording import (
    DASH,
    exclusion_meaning,
    format_count,
    format_exact,
    format_integer,
    format_number,
    format_signed,
    format_vaf,
    joined,
    method_name,
    parameter_name,
    status_meaning,
)

_BETWEEN_PARAGRAPHS: Final = re.compile("\n{2,}")
_ID: Final = re.compile(r'\bid="([^"]+)"')
_REFERENCE: Final = re.compile(r'(href="#|url\(#)([^")]+)')
_SVG_SIZE: Final = re.compile(r'(<svg[^>]*?) width="[^"]*" height="[^"]*"')
_SVG_STYLE: Final = re.compile(r'\s*<style type="text/css">.*?</style>', re.DOTALL)

_FILTERS: Final = {
    "braced": "{{{}}}".format,
    "count": format_count,
    "exact": format_exact,
    "exclusion_meaning": exclusion_meaning,
    "integer": format_integer,
    "joined": joined,
    "method_name": method_name,
    "number": format_number,
    "parameter_name": parameter_name,
    "signed": format_signed,
    "status_meaning": status_meaning,
    "unit": pretty_unit,
    "vaf": format_vaf,
}


def render_template(template: str, **values: Any) -> str:
    """Fill in a template of the report; text of the user stays text."""
    return _environment().get_template(template).render(dash=DASH, **values)


def render_paragraphs(template: str, **values: Any) -> list[str]:
    """Fill in a template of a text; an empty line begins a paragraph, other line ends are spaces.

    A template without any text has no paragraph.
    """
    blocks = _BETWEEN_PARAGRAPHS.split(render_template(template, **values).strip("\n"))
    return [block.replace("\n", " ") for block in blocks if block]


@cache
def _environment() -> Environment:
    """Return the templates; those of a text escape nothing."""
    environment = Environment(
        loader=PackageLoader("jointz.report"),
        autoescape=select_autoescape(disabled_extensions=["txt.j2"], default=True),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= _FILTERS
    return environment


def inline_svg(svg: str, name: str, label: str) -> Markup:
    """Prepare an SVG for a page that holds others: ids of its own, no size, no style sheet."""
    text = svg[svg.index("<svg") :]
    text = _ID.sub(rf'id="{name}-\1"', text)
    text = _REFERENCE.sub(rf"\1{name}-\2", text)
    text = _SVG_STYLE.sub("", text)
    text = _SVG_SIZE.sub(r"\1", text, count=1)
    attributes = Markup('<svg role="img" aria-label="{}" class="figure"').format(label)
    return Markup(text.replace("<svg", attributes, 1))


def page_figures(
    figures: Iterable[tuple[str, str, str, str]],
) -> dict[str, dict[str, Any]]:
    """Return figures for the macro ``figure``, numbered; each is name, SVG, heading, caption."""
    return {
        name: {
            "svg": inline_svg(svg, f"figure{number}", heading or f"Figure {number}"),
            "number": number,
            "caption": caption,
        }
        for number, (name, svg, heading, caption) in enumerate(figures, start=1)
    }
