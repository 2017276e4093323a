"""Leaderboards across runs and machines: verified runs in, suites with their rankings, and a static site."""

from uwbbench.leaderboard.content import Content
from uwbbench.leaderboard.folder import check_site, write_site
from uwbbench.leaderboard.render import rendered
from uwbbench.leaderboard.runs import Unverified, read_runs
from uwbbench.leaderboard.suites import suites

__all__ = ["Content", "Unverified", "check_site", "read_runs", "rendered", "suites", "write_site"]
