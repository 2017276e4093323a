"""Labels and addresses of detectors and datasets on a site: safe and distinct whatever their names hold."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

from uwbbench.config.identity import from_results, marked
from uwbbench.results.leaderboard.suites import Contender, Suite
from uwbbench.run.folder.identity import digest
from uwbbench.show.text.sheet import labels, shown

SHORT = 7
"""Digits of a hash that are shown; enough to distinguish versions by eye."""

LONGEST_SLUG = 40


class Names:
    """Labels and addresses of all detectors and datasets of a site.

    Parameters
    ----------
    suites : sequence of Suite
    """

    def __init__(self, suites: Sequence[Suite]) -> None:
        contenders = {one.key: one for suite in suites for one in suite.contenders}
        versions: dict[str, set[str]] = {}
        for one in contenders.values():
            versions.setdefault(one.name, set()).add(one.identity)
        short = labels(versions)
        versioned = {
            key: f"{short[one.name]} ({one.identity[:SHORT]})" if len(versions[one.name]) > 1 else short[one.name]
            for key, one in contenders.items()
        }
        versioned |= {
            key: marked(versioned[key], results_file=from_results(one.config), bound=one.bound)
            for key, one in contenders.items()
        }
        distinct = labels(versioned.values(), longest=60)
        self.detectors = {key: distinct[text] for key, text in versioned.items()}
        self._several = Counter((suite.name, tuple(suite.part.values())) for suite in suites)

    def suite(self, suite: Suite) -> str:
        """Name of a suite, with which part of it this is, and its version where there are several."""
        name, part = shown(suite.name), suite.part
        said = [
            *(["quick"] if part["quick"] else []),
            *([f"private, {part['seeds'][:SHORT]}"] if part["seeds"] else []),
        ]
        if self._several[suite.name, tuple(part.values())] > 1:
            said.append(f"version {suite.version[:SHORT]}")
        return f"{name} ({', '.join(said)})" if said else name

    @staticmethod
    def detector_page(contender: Contender) -> str:
        """Address of a detector's page."""
        return f"detectors/{slug(contender.name, contender.key)}.html"

    @staticmethod
    def dataset_page(suite: Suite, dataset: str) -> str:
        """Address of a dataset's page."""
        return f"datasets/{slug(dataset, digest([suite.name, suite.version, dataset]))}.html"


def slug(name: str, sha256: str) -> str:
    """Part of a file name: what is legible of a name, and a piece of a hash that makes it distinct.

    Examples
    --------
    >>> slug("../CFAR <b>", "0123456789abcdef")
    'cfar-b-0123456789'
    """
    legible = re.sub(r"[^a-z0-9]+", "-", name.lower(), flags=re.ASCII).strip("-")[:LONGEST_SLUG].strip("-")
    return f"{legible}-{sha256[:10]}" if legible else sha256[:10]
