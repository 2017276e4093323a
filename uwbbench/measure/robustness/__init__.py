"""Hard cases: inputs at which numerical code breaks, each with what a detector is expected to do."""

from uwbbench.measure.robustness.suite import Stability, all_cases, case_named, examine

__all__ = ["Stability", "all_cases", "case_named", "examine"]
