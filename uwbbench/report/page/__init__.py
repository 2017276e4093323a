"""The report as one HTML file that opens anywhere, offline, and its charts as pictures."""

from uwbbench.report.page.content import Content
from uwbbench.report.page.render import ReportToolsError, page, write_figures

__all__ = ["Content", "ReportToolsError", "page", "write_figures"]
