"""Writing pages: files that need no network, under a policy that lets nothing run but their own scripts.

Conventions
-----------
* A page is a template beside a script and a style sheet of its name, ``page/page.html`` with ``.js`` and ``.css``. They
  follow in the page after the script and style sheet of all pages.
* The content security policy names scripts and style by their hashes. Values are escaped by the template.
"""

from __future__ import annotations

import base64
import hashlib
import json
import zlib
from collections.abc import Collection
from functools import lru_cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from uwbbench.run.folder.identity import plain
from uwbbench.show.extras import report_tools

if TYPE_CHECKING:
    from jinja2 import Template


def document(template: str, bundle: str = "", **values: Any) -> str:
    """HTML of a page.

    Parameters
    ----------
    template : str
        Path of the template below ``show``, without its suffix.
    bundle : str
        Script of a library that the page's own needs.
    **values
        What the template shows; ``generator`` and ``badge`` are asked for by all.

    Raises
    ------
    ReportToolsError
        If Jinja2 is not installed.
    """
    with report_tools():
        from markupsafe import Markup
    style, script = (_text(f"html/base.{kind}") + _text(f"{template}.{kind}") for kind in ("css", "js"))
    scripts = [part for part in (bundle, script) if part]
    html = _template(f"{template}.html").render(
        **values,
        policy=_policy(scripts, style),
        style=Markup(style),  # noqa: S704 - our own
        scripts=[Markup(part) for part in scripts],  # noqa: S704 - our own, and that of a library
    )
    return html.encode("utf-8", "backslashreplace").decode()


def embedded(value: Any) -> str:
    """JSON for a script element: no character in it can end the element or start a comment."""
    from markupsafe import Markup

    text = json.dumps(plain(value), separators=(",", ":"), allow_nan=False)
    text = text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
    return Markup(text)  # noqa: S704 - cannot end its element


def packed(value: Any) -> str:
    """JSON for a script element, compressed: base64 of a zlib stream, which holds no character that could end it."""
    text = json.dumps(plain(value), separators=(",", ":"), allow_nan=False)
    return base64.b64encode(zlib.compress(text.encode(), 9)).decode()


def badge(sources: Collection[str]) -> str:
    """What the captures of a page are; simulated ones always say so.

    Examples
    --------
    >>> badge({"simulated"}), badge(["measured", "simulated"])
    ('SIMULATED', 'MEASURED AND SIMULATED')
    """
    kinds = {frozenset({"simulated"}): "SIMULATED", frozenset({"measured"}): "MEASURED", frozenset(): "NO RESULT"}
    return kinds.get(frozenset(sources), "MEASURED AND SIMULATED")


@lru_cache
def _template(path: str) -> Template:
    with report_tools():
        from jinja2 import Environment, FunctionLoader, StrictUndefined
    environment = Environment(
        loader=FunctionLoader(_text), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return environment.get_template(path)


@lru_cache
def _text(path: str) -> str:
    return files("uwbbench.show").joinpath(path).read_text(encoding="utf-8")


def _policy(scripts: Collection[str], style: str) -> str:
    """Content security policy: nothing from outside, and no script or style but these."""
    run, look = (" ".join(map(_hash, parts)) for parts in (scripts, [style]))
    rules = ("default-src 'none'", f"script-src {run}", f"style-src {look}", "img-src data:")
    return "; ".join((*rules, "base-uri 'none'", "form-action 'none'"))


def _hash(part: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(part.encode()).digest()).decode()}'"
