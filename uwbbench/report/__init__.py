"""Tables, pages and charts made from a run folder alone, for people and for programs."""

from uwbbench.report.render import markdown, sheets, write_report
from uwbbench.report.report import Report, read_safely
from uwbbench.report.sheet import Sheet

__all__ = ["Report", "Sheet", "markdown", "read_safely", "sheets", "write_report"]
