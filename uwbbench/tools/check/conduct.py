"""Checks of how any plugin behaves while it works: alone, again, elsewhere, in threads, and towards the process."""

from __future__ import annotations

import contextlib
import io
import os
import random
import warnings
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from uwbbench.api.case import NotApplicable
from uwbbench.tools.check.check import Nonconformity, check
from uwbbench.tools.check.subject import Subject
from uwbbench.tools.check.values import read_only, same

THREADS = 3


@check("uwbbench.api.stage.Stage")
def same_twice(subject: Subject) -> None:
    """Two runs on the same input are equal bit for bit: a benchmark must be repeatable, so seed every generator."""
    same(subject.usual, subject.result(), "the same result again")


@check("uwbbench.api.stage.Stage")
def same_in_another_process(subject: Subject) -> None:
    """A new process with another hash seed gives the same bits: the order of a set or ``hash`` must decide nothing."""
    if subject.digest_elsewhere != subject.digest:
        found = subject.digest_elsewhere
        is_hash = len(found) == len(subject.digest) and " " not in found
        observed = f"hash {found[:12]}, here {subject.digest[:12]}" if is_hash else found
        raise Nonconformity("the same result in another process", observed)


@check("uwbbench.api.stage.Stage")
def threads_agree(subject: Subject) -> None:
    """Instances in several threads at once give what one alone gives: state belongs to the instance, not the module."""
    usual = subject.usual
    with ThreadPoolExecutor(THREADS) as pool:
        for found in [pool.submit(subject.result) for _ in range(2 * THREADS)]:
            same(usual, found.result(), "the same result in each thread")


@check("uwbbench.api.block.Block")
def inputs_unchanged(subject: Subject) -> None:
    """Input arrays are never written into: other plugins look at the same arrays."""
    arrays = subject.input_arrays()
    if not arrays:
        raise NotApplicable("it is given no arrays")
    with read_only(arrays):
        subject.result()


@check("uwbbench.api.stage.Stage.note")
def prints_nothing(subject: Subject) -> None:
    """Nothing is printed: the output belongs to the command, and readers of results learn by ``note``."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
        subject.result()
    if out.getvalue():
        first = out.getvalue().strip().partition("\n")[0]
        raise Nonconformity("no output", f"{len(out.getvalue())} characters, which start with {first[:80]!r}")


@check("uwbbench.api.stage.Stage.note")
def warns_of_nothing(subject: Subject) -> None:
    """No warning is raised: a division by zero in a frame of zeros is a case to be handled, not to be warned of."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        subject.result()
    if caught:
        first = caught[0]
        observed = f"{first.category.__name__}: {first.message} ({os.path.basename(first.filename)}:{first.lineno})"  # noqa: PTH119
        raise Nonconformity("no warning", observed)


@check("uwbbench.api.stage.Stage")
def leaves_the_process_alone(subject: Subject) -> None:
    """Random state, numpy's error handling, warning filters, environment and current folder stay: others rely on it."""
    before = _process_state()
    subject.result()
    changed = [name for name, value in _process_state().items() if value != before[name]]
    if changed:
        raise Nonconformity("a process as it was before", f"changed: {', '.join(changed)}")


def _process_state() -> dict[str, Any]:
    return {
        "numpy's global random state": repr(np.random.get_state(legacy=False)),  # noqa: NPY002 - to see if it was used
        "random's global state": random.getstate(),
        "numpy's error handling": np.geterr(),
        "numpy's print options": np.get_printoptions(),
        "warning filters": list(warnings.filters),
        "environment variables": dict(os.environ),
        "current folder": os.getcwd(),  # noqa: PTH109
    }


CHECKS = (
    same_twice,
    same_in_another_process,
    threads_agree,
    inputs_unchanged,
    prints_nothing,
    warns_of_nothing,
    leaves_the_process_alone,
)
