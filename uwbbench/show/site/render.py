"""The files of a site: its pages as HTML, and its data for programs."""

from __future__ import annotations

import json
from collections.abc import Mapping

from uwbbench.run.folder.identity import plain
from uwbbench.show.html.render import document
from uwbbench.show.site.content import Content
from uwbbench.show.site.matrix import CSV, matrix_csv
from uwbbench.show.site.pages import pages

DATA = "leaderboard.json"
NO_JEKYLL = ".nojekyll"
"""Makes GitHub Pages serve the files as they are."""


def rendered(content: Content) -> Mapping[str, str]:
    """All files of a site, by their address.

    Raises
    ------
    ReportToolsError
        If Jinja2 or vl-convert is not installed.
    """
    documents = {
        page.address: document(
            "site/site", generator="uwbbench leaderboard", badge=page.badge, lead=page.lead, page=page
        )
        for page in pages(content)
    }
    data = json.dumps(plain(content.to_dict()), indent=1, allow_nan=False)
    return {**documents, DATA: f"{data}\n", CSV: matrix_csv(content), NO_JEKYLL: ""}
