"""A leaderboard as a static site."""

from uwbbench.show.site.content import Content
from uwbbench.show.site.folder import check_site, write_site
from uwbbench.show.site.render import rendered

__all__ = ["Content", "check_site", "rendered", "write_site"]
