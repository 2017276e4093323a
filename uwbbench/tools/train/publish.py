"""What a training leaves behind: the weights file, and a summary beside it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from uwbbench.api.errors import StoreError
from uwbbench.api.weights import SUFFIX
from uwbbench.run.folder.files import replacing, write_json
from uwbbench.run.folder.identity import plain
from uwbbench.show.text.numbers import number
from uwbbench.show.text.sheet import Sheet, shown
from uwbbench.tools.train.execute import Trained


def checked_target(path: Path) -> Path:
    """File to write, refused before anything is trained where it cannot be.

    Raises
    ------
    StoreError
        If its name does not say that it holds weights, or its folder is not there.
    """
    if path.suffix != SUFFIX:
        raise StoreError(f"{path}: expected a name that ends in {SUFFIX}")
    if not path.resolve().parent.is_dir():
        raise StoreError(f"{path}: there is no such folder")
    return path


def publish(trained: Trained, path: Path) -> Path:
    """Write the weights, and a summary as JSON beside them.

    Parameters
    ----------
    trained : Trained
    path : Path
        Of the weights file; one that is there is replaced.

    Returns
    -------
    Path
        The summary.

    Raises
    ------
    StoreError
        If a file cannot be written.
    """
    with replacing(checked_target(path)) as partial:
        partial.write_bytes(trained.content)
    summary = path.with_suffix(".json")
    write_json(summary, to_dict(trained))
    return summary


def to_dict(trained: Trained) -> dict[str, Any]:
    """Results as plain values."""
    training = trained.training
    return dict(
        plain(
            {
                "training": training.name,
                "detector": training.detector.name,
                "step": training.step.label,
                "source": trained.source,
                "split": training.model.split.model_dump(),
                "sha256": trained.sha256,
                "bytes": len(trained.content),
                "seed": training.model.seed,
                "versions": trained.about.versions,
                "scores": [
                    {"on": one.on, "captures": one.captures, "units": one.units, "frames": one.frames, **one.figures}
                    for one in trained.scores
                ],
            }
        )
    )


def sheets(trained: Trained) -> list[Sheet]:
    """The figures of each role and dataset."""
    training, mark = trained.training, "" if trained.source == "measured" else ", SIMULATED"
    names = tuple(dict.fromkeys(name for one in trained.scores for name in one.figures))
    by = training.model.split.by
    rows = tuple(
        (
            shown(one.on),
            str(one.captures),
            str(one.units),
            str(one.frames),
            *(number(one.figures.get(name, math.nan), 3) for name in names),
        )
        for one in trained.scores
    )
    split = "no validation" if not training.validation else "validation captures chose, or may have chosen"
    return [
        Sheet(
            f"{training.step.use} of {training.detector.name} trained by '{training.name}'{mark}",
            ("captures", "count", f"{by}s", "frames", *names),
            rows,
            (
                f"split by {by}: none is on two sides; {split}; what is held out neither trained nor chose",
                f"weights of {len(trained.content) / 1000:.0f} kB, SHA-256 {trained.sha256}",
            ),
        )
    ]
