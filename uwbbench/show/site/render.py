"""Pages as HTML: no request leaves them, and no script runs but their own."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Mapping
from importlib.resources import files

from uwbbench.run.folder.identity import plain
from uwbbench.show.page.render import NEEDS, ReportToolsError
from uwbbench.show.site.content import Content
from uwbbench.show.site.pages import pages

DATA = "leaderboard.json"
NO_JEKYLL = ".nojekyll"
"""Tells GitHub Pages to serve the files as they are."""


def rendered(content: Content) -> Mapping[str, str]:
    """All files of a site, by their address.

    Raises
    ------
    ReportToolsError
        If Jinja2 or vl-convert is not installed.
    """
    try:
        from jinja2 import Environment, StrictUndefined
        from markupsafe import Markup
    except ImportError as error:
        raise ReportToolsError(NEEDS) from error
    script = _text("uwbbench.show.site", "site.js")
    style = _text("uwbbench.show.page", "page.css") + _text("uwbbench.show.site", "site.css")
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    template = environment.from_string(_text("uwbbench.show.site", "site.html"))
    found = {}
    for page in pages(content):
        html = template.render(
            page=page,
            policy=_policy(script, style),
            style=Markup(style),  # noqa: S704 - our own
            script=Markup(script),  # noqa: S704 - our own
        )
        found[page.address] = html.encode("utf-8", "backslashreplace").decode()
    data = json.dumps(plain(content.to_dict()), indent=1, allow_nan=False)
    return {**found, DATA: f"{data}\n", NO_JEKYLL: ""}


def _text(package: str, name: str) -> str:
    return files(package).joinpath(name).read_text(encoding="utf-8")


def _policy(script: str, style: str) -> str:
    """Content security policy: nothing from outside, and no script or style but these."""
    scripts, styles = (
        f"'sha256-{base64.b64encode(hashlib.sha256(part.encode()).digest()).decode()}'" for part in (script, style)
    )
    rules = ("default-src 'none'", f"script-src {scripts}", f"style-src {styles}", "img-src data:")
    return "; ".join((*rules, "base-uri 'none'", "form-action 'none'"))
