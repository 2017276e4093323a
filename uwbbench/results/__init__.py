"""What stored runs say, as numbers: nothing is run here, and nothing is drawn."""

from uwbbench.results.report import Report, read_safely

__all__ = ["Report", "read_safely"]
