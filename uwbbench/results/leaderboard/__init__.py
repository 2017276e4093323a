"""Leaderboards across runs and machines: verified runs in, suites with their rankings out."""

from uwbbench.results.leaderboard.runs import Unverified, read_runs
from uwbbench.results.leaderboard.suites import suites

__all__ = ["Unverified", "read_runs", "suites"]
