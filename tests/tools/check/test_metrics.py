"""A metric that is broken in one place is caught by the check that is about it."""

import pytest

from uwbbench.tools.check import all_checks
from uwbbench.tools.check.conduct import CHECKS as CONDUCT
from uwbbench.tools.check.source import CHECKS as SOURCE

GOOD = '''"""A module."""

import math

import numpy as np

from uwbbench.api import Metric


class Broken(Metric):
    """Mean absolute error."""

    unit = "m"
    better = "lower"

    @staticmethod
    def partial(outcome):
        """Sum and count."""
        error_m = np.abs(outcome.error_m[np.isfinite(outcome.error_m)])
        return np.array([error_m.sum(), len(error_m)])

    @staticmethod
    def value(partial):
        """Mean."""
        return float(partial[0] / partial[1]) if partial[1] else math.nan
'''
VALUE = "return float(partial[0] / partial[1]) if partial[1] else math.nan"
PARTS = '''

    kind = "ratio"

    @classmethod
    def parts(cls, partial):
        """Wrong."""
        return float(partial[0]), float(partial[1]) * 1.001
'''
BROKEN = {
    "docstring-says-what-it-is": (("Mean absolute error.", "Mean absolute error"), "'Mean absolute error'"),
    "attributes-are-valid": (('better = "lower"', 'better = "less"'), "'less'"),
    "display-is-valid": (('unit = "m"', 'unit = "m"\n    shown_as = ("cm", 100)'), "('cm', 100)"),
    "unit-is-given": (('unit = "m"', 'unit = ""'), "unit = ''"),
    "partials-are-flat-arrays": (("len(error_m)])", "len(error_m)], dtype=np.float32)"), "float32"),
    "value-is-a-float": (("float(partial[0] / partial[1])", "partial[0] / partial[1]"), "float64"),
    "grouping-does-not-matter": (
        ("[error_m.sum(), len(error_m)]", "[error_m.mean() if len(error_m) else 0.0, 1.0]"),
        "",
    ),
    "nothing-is-undefined": (("else math.nan", "else 0.0"), "0.0 with n"),
    "perfection-is-best": (('better = "lower"', 'better = "higher"'), "perfect 0"),
    "interval-brackets-the-value": ((VALUE + "\n", VALUE + PARTS.replace("1.001", "9")), " to "),
    "kind-fits": ((VALUE + "\n", VALUE + PARTS), "from the parts of a ratio"),
    "errors-that-are-nan-are-left-out": (("[np.isfinite(outcome.error_m)]", ""), "nan"),
    "open-truth-is-fine": (
        ("        error_m =", "        1 / outcome.exhaustive\n        error_m ="),
        "ZeroDivisionError",
    ),
    "inputs-unchanged": (
        ("        error_m =", "        outcome.error_m[:] += 0\n        error_m ="),
        "attempt to write",
    ),
    "same-twice": (("error_m.sum()", "error_m.sum() + np.random.default_rng().uniform()"), "partial 0"),
    "runs-no-foreign-code": (("import math", "import math\nimport pickle"), "broken_module.py:4: pickle"),
}


@pytest.mark.parametrize("check", BROKEN)
def test_a_broken_metric_is_caught_by_the_check_that_is_about_it(judged, check):
    (old, new), found = BROKEN[check]
    assert old in GOOD
    result = judged("metric", GOOD.replace(old, new), check)
    assert result.status in ("failed", "error"), result
    assert found in result.found


def test_every_check_of_metrics_alone_is_broken_once():
    shared = {one.name for one in (*CONDUCT, *SOURCE)}
    assert {one.name for one in all_checks("metric")} - shared <= BROKEN.keys()


def test_the_same_metric_unbroken_passes_all(examine_plugin):
    found = examine_plugin("metric", GOOD)
    assert found.passed, [one.explain() for one in found.results if not one.passed]
