"""Pages that need no other file: a template filled in, with figures and styles inside."""

import re
from collections.abc import Iterable
from typing import Any, Final

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from jointz.core.channels import pretty_unit
from jointz.report.wording import DASH, format_integer, format_signed

_ID: Final = re.compile(r'\bid="([^"]+)"')
_REFERENCE: Final = re.compile(r'(href="#|url\(#)([^")]+)')
_SVG_SIZE: Final = re.compile(r'(<svg[^>]*?) width="[^"]*" height="[^"]*"')
_SVG_STYLE: Final = re.compile(r'\s*<style type="text/css">.*?</style>', re.DOTALL)


def render_template(template: str, **values: Any) -> str:
    """Fill in a template of the report; text of the user stays text."""
    environment = Environment(
        loader=PackageLoader("jointz.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"integer": format_integer, "signed": format_signed, "unit": pretty_unit}
    return environment.get_template(template).render(dash=DASH, **values)


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
