"""Two runs side by side: what changed in what went in, then in what came out, then in which frames."""

from uwbbench.results.comparison.compare import Comparison, compare

__all__ = ["Comparison", "compare"]
