"""Tables of a run as text: terminal, Markdown, CSV, LaTeX and JSON."""

from uwbbench.show.text.report import markdown, sheets, write_report
from uwbbench.show.text.sheet import Sheet

__all__ = ["Sheet", "markdown", "sheets", "write_report"]
