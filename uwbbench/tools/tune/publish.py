"""What a tuning leaves behind: detectors, a table of all sets, a manifest and a summary."""

from __future__ import annotations

import dataclasses
import os
import re
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from uwbbench.api.errors import StoreError
from uwbbench.detect.pipeline import Pipeline
from uwbbench.run.environment import session
from uwbbench.run.folder.files import disk_errors, write_json, write_parquet, write_text
from uwbbench.run.folder.identity import plain
from uwbbench.tools.tune.captures import Labelled
from uwbbench.tools.tune.evaluate import Result
from uwbbench.tools.tune.execute import Tuned, TuneOutcome, variant
from uwbbench.tools.tune.sheets import markdown
from uwbbench.tools.tune.sweep.scores import RATIOS

FORMAT, VERSION = "uwbbench-tuning", 1


def new_folder(name: str, out: Path | None) -> Path:
    """Folder for the results, made now so that nothing is computed in vain.

    Parameters
    ----------
    name : str
        Name of the tuning.
    out : Path or None
        None for ``tunings/NAME-TIME``.

    Raises
    ------
    StoreError
        If it exists and holds anything, or cannot be made.
    """
    folder = Path("tunings") / f"{_safe(name)}-{datetime.now():%Y%m%d-%H%M%S}" if out is None else out
    with disk_errors(folder, "made"):
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise StoreError(f"{folder}: already exists and is not empty; give another folder")
        folder.mkdir(parents=True, exist_ok=True)
    return folder


def publish(outcome: TuneOutcome, folder: Path) -> list[Path]:
    """Write all results into a folder.

    ====================  =======================================================================
    ``NAME-GROUP.yaml``   tuned detector of each group
    ``sets.parquet``      every set that was tried: group, values, and scores on the tuning captures
    ``summary.md``        the table for people
    ``manifest.json``     resolved configuration, results, hashes of captures, versions, command
    ====================  =======================================================================

    Parameters
    ----------
    outcome : TuneOutcome
    folder : Path
        That :func:`new_folder` made.

    Returns
    -------
    list of Path
        Detector files.

    Raises
    ------
    StoreError
        If a file cannot be written.
    """
    files: list[Path] = []
    for tuned in outcome.groups:
        name = _safe(detector_name(outcome, tuned))
        while (path := folder / f"{name}.yaml") in files:  # materials may differ in what file names cannot hold
            name += "-other"
        files.append(path)
        write_text(path, detector_yaml(outcome, tuned, folder))
    write_parquet(folder / "sets.parquet", table_of(outcome), {"tuning": outcome.tuning.name})
    write_text(folder / "summary.md", markdown(outcome))
    write_json(folder / "manifest.json", manifest(outcome))
    return files


def detector_name(outcome: TuneOutcome, tuned: Tuned) -> str:
    """Name of the tuned detector of a group."""
    return f"{outcome.tuning.detector.name}-tuned-{tuned.group.name}"


def detector_yaml(outcome: TuneOutcome, tuned: Tuned, folder: Path) -> str:
    """Detector file with the tuned values, as it must stand in ``folder``.

    Parameters
    ----------
    outcome : TuneOutcome
    tuned : Tuned
        Group of it that the detector is tuned for.
    folder : Path
        Where the file will lie: the path of the detector that it extends is relative to it.

    Returns
    -------
    str
        YAML.
    """
    import yaml

    tuning = outcome.tuning
    named = os.path.relpath(tuning.use, folder.resolve()) if Path(tuning.use).is_absolute() else tuning.use
    data = {
        "schema": 1,
        "extends": named,
        "name": detector_name(outcome, tuned),
        "description": _description(outcome, tuned),
        "set": plain({**tuning.model.set, **tuned.values}),
    }
    return yaml.safe_dump(data, sort_keys=False, allow_unicode=True, width=110)


def _description(outcome: TuneOutcome, tuned: Tuned) -> str:
    """What the detector was tuned on, and what that is worth."""
    model, group = outcome.tuning.model, tuned.group
    rules = f"scoring {model.scoring} after {model.table}, gate {100 * model.gate_m:g} cm"
    text = (
        f"'{outcome.tuning.detector.name}' tuned for {group.text}: highest F1, then lowest RMSE, of "
        f"{len(tuned.scores.tp)} sets on {_counted(group.tuning)} ({_datasets(group.tuning)}). "
        f"F1 {tuned.after.scores.f1[0]:.3f} there"
    )
    if tuned.held_out_after is None:
        text += "; no capture was held out"
    else:
        text += f", {tuned.held_out_after.scores.f1[0]:.3f} on {_counted(group.held_out)} held out"
    return f"{text} ({rules})."


def _counted(captures: Sequence[Labelled]) -> str:
    sources = {one.capture.source for one in captures}
    kind = f"{sources.pop()} " if len(sources) == 1 else "measured and simulated "
    return f"{len(captures)} {kind}capture{'s' if len(captures) > 1 else ''}"


def _datasets(captures: Sequence[Labelled]) -> str:
    return ", ".join(dict.fromkeys(one.dataset for one in captures))


def table_of(outcome: TuneOutcome) -> Any:
    """Every set of every group as an Arrow table."""
    import pyarrow as pa

    tables = []
    for tuned in outcome.groups:
        scores, sets = tuned.scores, len(tuned.scores.tp)
        columns: dict[str, Any] = {"group": [tuned.group.name] * sets, "set": np.arange(sets)}
        columns |= {path: _storable(column) for path, column in tuned.columns.items()}
        columns |= {name: getattr(scores, name) for name in RATIOS}
        columns |= {name: getattr(scores, name) for name in ("tp", "fp", "fn")}
        columns["stable"] = [None] * sets if tuned.zone is None else tuned.zone.inside
        columns["chosen"] = np.arange(sets) == tuned.best
        tables.append(pa.table(columns))
    return pa.concat_tables(tables, promote_options="permissive")


def _storable(column: list[Any]) -> list[Any]:
    """Column of one type: choices of several types, which a table cannot hold, as text."""
    kinds = {float if type(value) is int else type(value) for value in column if value is not None}
    return column if len(kinds) < 2 else [None if value is None else str(value) for value in column]


def manifest(outcome: TuneOutcome) -> dict[str, Any]:
    """All that the results depend on, and the results."""
    tuning = outcome.tuning
    search = tuning.model.search
    return {
        "format": FORMAT,
        "format_version": VERSION,
        "tuning": tuning.to_dict(),
        "detector": Pipeline(tuning.detector).identity,
        "optuna": None
        if search is None
        else {
            "version": _optuna_version(),
            "trials": search.trials,
            "sampler": search.sampler,
            "seed": search.seed,
        },
        "captures": {
            "tuning": [_about(one) for one in outcome.captures],
            "held_out": [_about(one) for one in outcome.held_out],
        },
        "results": to_dict(outcome)["groups"],
        "session": session(1),
    }


def _about(one: Labelled) -> dict[str, Any]:
    capture = one.capture
    return {
        "dataset": one.dataset,
        "capture": capture.name,
        "source": capture.source,
        "license": capture.license,
        "sha256": capture.sha256,
        "channel": capture.radar.channel,
        "materials": one.materials,
        "frames": len(capture),
    }


def _optuna_version() -> str:
    from importlib.metadata import version

    return version("optuna")


def to_dict(outcome: TuneOutcome) -> dict[str, Any]:
    """Results as plain values."""
    return dict(
        plain(
            {
                "tuning": outcome.tuning.name,
                "detector": outcome.tuning.detector.name,
                "scoring": outcome.tuning.model.scoring,
                "table": outcome.tuning.model.table,
                "gate_m": outcome.tuning.model.gate_m,
                "groups": [_group(outcome, tuned) for tuned in outcome.groups],
                "notes": outcome.notes,
            }
        )
    )


def _group(outcome: TuneOutcome, tuned: Tuned) -> dict[str, Any]:
    def of(result: Result | None) -> dict[str, Any] | None:
        return None if result is None else result.to_dict()

    zone = tuned.zone
    written = dataclasses.replace(variant(outcome.tuning, tuned.values).config, name=detector_name(outcome, tuned))
    return {
        "group": tuned.group.name,
        "material": tuned.group.material,
        "channel": tuned.group.channel,
        "name": detector_name(outcome, tuned),
        "identity": Pipeline(written).identity,
        "values": tuned.values,
        "sets": len(tuned.scores.tp),
        "tuning": {"before": of(tuned.before), "after": of(tuned.after)},
        "held_out": {"before": of(tuned.held_out_before), "after": of(tuned.held_out_after)},
        "stable_zone": None
        if zone is None
        else {"within": zone.within, "share": zone.share, "regions": zone.regions, "spans": zone.spans},
    }


def _safe(name: str) -> str:
    """Part of a file name, whatever a detector or material is called."""
    return re.sub(r"[^\w.-]+", "-", name, flags=re.ASCII).strip("-.")[:80] or "tuning"
