"""The report as one HTML file that opens anywhere, offline, and its charts as pictures."""

from uwbbench.show.page.content import Content
from uwbbench.show.page.render import page, write_figures

__all__ = ["Content", "page", "write_figures"]
