"""Conformance checks of plugins: what every stage, mapper, detector, dataset and metric must do, each with a name."""

from uwbbench.tools.check.suite import Conformance, all_checks, checks_for, checks_of, examine, kinds_of, subject_of

__all__ = ["Conformance", "all_checks", "checks_for", "checks_of", "examine", "kinds_of", "subject_of"]
