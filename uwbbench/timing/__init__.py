"""Measuring how fast a detector is: one at a time, each in a fresh process, every call kept."""

from uwbbench.timing.latency import Latency
from uwbbench.timing.launch import LatencyError, measure

__all__ = ["Latency", "LatencyError", "measure"]
