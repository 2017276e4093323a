"""Making a suite of an experiment: every capture is opened once, and what it is known by is written down."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from joblib import Parallel, delayed

from uwbbench.config.given import Given, read_given
from uwbbench.config.source import CaptureRef
from uwbbench.measure.latency.machine import usable_cores
from uwbbench.run.experiment import read_experiment
from uwbbench.run.folder.identity import suite_version
from uwbbench.run.folder.scored import rules_of
from uwbbench.run.suite import Frozen, Mark, lock_of


def freeze(name: Given, data_dir: Path | None = None, progress: Callable[[str], None] | None = None) -> Frozen:
    """Freeze the captures and rules of an experiment; captures of optional datasets are left out.

    Parameters
    ----------
    name : str or Path
        Shipped name or file.
    data_dir : Path, optional
        First folder in which datasets are searched.
    progress : callable, optional
        Called with the name of each dataset before its captures are opened.

    Returns
    -------
    Frozen
        What was written beside the experiment's file.

    Raises
    ------
    UwbbenchError
        If the experiment is wrong, a capture cannot be opened, or the file cannot be written.
    """
    path, _ = read_given("experiments", name)
    experiment = read_experiment(name, data_dir=data_dir, frozen=False)
    captures: dict[str, dict[str, Mark]] = {}
    for dataset in experiment.datasets:
        if dataset.optional:
            continue
        if progress is not None:
            progress(dataset.label)
        references = dataset.references()
        pool: Any = Parallel(n_jobs=usable_cores())
        marks = pool(delayed(_marked)(one) for one in references)
        captures[dataset.label] = {one.name: mark for one, mark in zip(references, marks, strict=True)}
    contents = {(label, name): mark.sha256 for label, marks in captures.items() for name, mark in marks.items()}
    rules = [rule.to_dict() for rule in rules_of(experiment.to_dict())]
    frozen = Frozen(lock_of(path), experiment.name, suite_version(contents, rules), captures)
    frozen.write()
    return frozen


def _marked(reference: CaptureRef) -> Mark:
    return Mark.of(reference.open())
