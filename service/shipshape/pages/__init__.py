"""Reports as one HTML page that needs nothing else: no network, no other file. Needs the reporter's extra."""

from importlib.resources import files
from typing import Any

import jinja2
from markupsafe import Markup


def to_html(package: str, values: dict[str, Any], pictures: dict[str, str]) -> str:
    """The template `page.html` of a package, filled; whatever values hold is shown as text.

    Args:
        package: Where the template is.
        values: What it names; beside them it has `style`, `pictures` and the filters `ms` and `percent`.
        pictures: SVG elements by their titles.
    """
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True)
    environment.filters["ms"] = _ms
    environment.filters["percent"] = lambda share: f"{share:.2%}"
    template = environment.from_string(_text(package, "page.html"))
    svgs = {title: Markup(svg) for title, svg in pictures.items()}
    return template.render(style=Markup(_text("shipshape.pages", "style.html")), pictures=svgs, **values)


def _text(package: str, name: str) -> str:
    return files(package).joinpath(name).read_text(encoding="utf-8")


def _ms(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}" if value < 100 else f"{value:.0f}"
