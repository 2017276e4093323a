"""Checks as a suite: their names and statements, as tests of a plugin's author, and what cannot be checked."""

import pydoc
import re
import unittest

import pytest

from uwbbench.api import ConfigError, PluginError
from uwbbench.api.registry import AUTHORED_KINDS
from uwbbench.tools.check import all_checks, checks_for, kinds_of, subject_of

EVERY = [pytest.param(one, id=f"{kind}-{one.name}") for kind in AUTHORED_KINDS for one in all_checks(kind)]
KERNEL = '''"""A kernel that finds nothing."""

import numpy as np
from uwbbench.api.kernel import Kernel


class Wrong(Kernel):
    """Takes over all stages."""

    @classmethod
    def covers(cls, stages):
        """All."""
        return len(stages)

    def detect(self, frames, first_path):
        """Nothing."""
        from uwbbench.api import Detections

        return Detections(np.empty(0, int), range_m=np.empty(0), processed=frames.index)
'''


@pytest.mark.parametrize("kind", AUTHORED_KINDS)
def test_checks_of_a_kind_have_names_of_their_own(kind):
    names = [one.name for one in all_checks(kind)]
    assert len(set(names)) == len(names) > 20


@pytest.mark.parametrize("one", EVERY)
def test_a_check_says_what_is_asked_and_where_to_read_more(one):
    assert re.fullmatch(r"[a-z0-9-]+", one.name)
    assert one.statement.endswith(".")
    assert len(one.statement.split()) >= 5
    command, _, place = one.read_more.rpartition(" ")
    assert command != "python -m pydoc" or pydoc.locate(place) is not None


def test_checks_are_tests_that_pass_skip_or_explain(examine_plugin):
    source = 'from uwbbench.api import Params, Stage\n\n\nclass Broken(Stage[Params]):\n    """No full stop"""\n'
    examine_plugin("stage", source, "origin-is-stated")
    checks = dict(checks_for("stage", "broken"))
    assert list(checks) == [one.name for one in all_checks("stage")]
    checks["origin-is-stated"]()
    with pytest.raises(unittest.SkipTest, match="the stage is no filter"):
        checks["filters-reject-nan"]()
    with pytest.raises(
        AssertionError, match=r"(?s)stage 'broken': failed docstring-says-what-it-is: .*found: +'No full"
    ):
        checks["docstring-says-what-it-is"]()
    with pytest.raises(AssertionError, match="NotImplementedError"):
        checks["stream-equals-batch"]()


def test_a_class_of_another_kind_is_refused(install_plugin):
    install_plugin("odd", {"stages": {"odd": "odd_module:Odd"}}, {"odd_module.py": "class Odd:\n    pass\n"})
    with pytest.raises(PluginError, match=r"stage 'odd' of odd 1\.0: odd_module:Odd is no Stage"):
        subject_of("stage", "odd")


def test_a_plugin_that_cannot_be_imported_is_refused_with_the_reason(install_plugin):
    install_plugin("odd", {"stages": {"odd": "odd_module:Odd"}}, {"odd_module.py": "import not_there\n"})
    with pytest.raises(PluginError, match="No module named 'not_there'"):
        subject_of("stage", "odd")


def test_parameters_that_do_not_exist_are_refused(install_plugin):
    with pytest.raises(ConfigError, match="metric 'recall' has no parameters"):
        subject_of("metric", "recall", {"a": 1})
    with pytest.raises(ConfigError, match=r"unknown key 'relative_hight'\. Did you mean 'relative_height'"):
        subject_of("stage", "peaks", {"relative_hight": 1})


def test_a_name_of_two_kinds_is_checked_as_both(install_plugin):
    source = 'from uwbbench.api import Params, Stage\n\n\nclass Recall(Stage[Params]):\n    """A."""\n'
    install_plugin("two", {"stages": {"recall": "two_module:Recall"}}, {"two_module.py": source})
    assert kinds_of("recall") == ("stage", "metric")


def test_a_kernel_that_finds_something_else_is_caught_in_the_detector_that_it_takes_over(install_plugin):
    install_plugin("kernel", {"kernels": {"a.wrong": "kernel_module:Wrong"}}, {"kernel_module.py": KERNEL})
    with pytest.raises(AssertionError, match=r"found: +detections: shape"):
        dict(checks_for("detector", "paper-filtering"))["fused-equals-plain"]()
