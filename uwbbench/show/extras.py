"""Libraries that are an extra of the installation, and what to say where they are missing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from uwbbench.api.errors import UwbbenchError


class ReportToolsError(UwbbenchError):
    """The libraries that make pages, charts and LaTeX are not installed."""


@contextmanager
def report_tools() -> Iterator[None]:
    """Import vl-convert or Jinja2, or say how to get them.

    Raises
    ------
    ReportToolsError
        If one is not installed.
    """
    try:
        yield
    except ImportError as error:
        raise ReportToolsError(
            "HTML, LaTeX and charts need vl-convert and Jinja2; install them with: pip install 'uwbbench[report]'"
        ) from error
