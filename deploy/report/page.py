"""HTML reports: one base template, `page.html.jinja`, which a report's own template extends."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from typing import TYPE_CHECKING

from deploy.report.tables import UNKNOWN, with_unit

if TYPE_CHECKING:
    from collections.abc import Callable


def render(package: str, template: str, filters: Mapping[str, Callable[..., str]], **values: object) -> str:
    """A page that opens offline. Every text is escaped; `filters` are the report's own."""
    import jinja2

    loaders = [jinja2.PackageLoader(name, ".") for name in (package, "deploy.report")]
    environment = jinja2.Environment(
        loader=jinja2.ChoiceLoader(loaders),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters |= {"data_uri": data_uri, "or_dash": or_dash, "with_unit": with_unit, **filters}
    return environment.get_template(template).render(**values)


def data_uri(image: str | bytes) -> str:
    """An image that lies within the page: SVG as text, PNG as bytes."""
    kind, raw = ("svg+xml", image.encode()) if isinstance(image, str) else ("png", image)
    return f"data:image/{kind};base64,{base64.b64encode(raw).decode('ascii')}"


def or_dash(value: object) -> str:
    """A value for people: two decimals, yes or no, or a dash where there is none."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None:
        return UNKNOWN
    return f"{value:.2f}" if isinstance(value, float) else str(value)
