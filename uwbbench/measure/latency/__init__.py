"""Measuring how fast a detector is: one at a time, each in a fresh process, every call kept."""

from uwbbench.measure.latency.latency import Latency
from uwbbench.measure.latency.launch import LatencyError, measure

__all__ = ["Latency", "LatencyError", "measure"]
