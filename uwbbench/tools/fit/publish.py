"""What a fit leaves behind: calibrated scenes and robot, every residual, every trial, and a manifest."""

from __future__ import annotations

import dataclasses
import io
from collections.abc import Iterable
from csv import DictWriter
from importlib.metadata import version
from pathlib import Path
from textwrap import wrap
from typing import Any

from uwbbench.api.text import one_line
from uwbbench.detect.pipeline import Pipeline
from uwbbench.run.environment import session
from uwbbench.run.folder.files import write_json, write_parquet, write_text
from uwbbench.run.folder.identity import plain
from uwbbench.tools.fit.config import Fit
from uwbbench.tools.fit.evaluate import Residual
from uwbbench.tools.fit.execute import FitOutcome, Progress, check
from uwbbench.tools.fit.files import ROBOT, write_changed
from uwbbench.tools.fit.sheets import markdown, wanted

FORMAT, VERSION = "uwbbench-fit", 1
_WIDTH = 116


def write_outcome(outcome: FitOutcome, folder: Path, progress: Progress = lambda _: None) -> FitOutcome:
    """Write the calibrated files, take the residuals of just these files on unseen draws, and write all of it.

    ==================  ==========================================================================
    scenes and robot    under their own names, with a header that says what was fitted, and to what
    ``residuals.csv``   every target beside what the calibrated files give, draw by draw
    ``trials.parquet``  every set of values that was tried, with its cost on the draws of the fit
    ``summary.md``      the tables for people
    ``manifest.json``   resolved configuration, results, hashes, versions, command
    ==================  ==========================================================================

    Parameters
    ----------
    outcome : FitOutcome
        Of :func:`~uwbbench.tools.fit.execute.fit`.
    folder : Path
        New folder.
    progress : callable
        Receives what is being done, for people.

    Returns
    -------
    FitOutcome
        With the residuals.

    Raises
    ------
    StoreError
        If a file cannot be written.
    """
    plan = outcome.fit
    changes = plan.changes(outcome.best.values)
    files = write_changed(plan.files, changes, folder)
    outcome = dataclasses.replace(outcome, residuals=check(plan, files, progress))
    write_changed(plan.files, changes, folder, lambda name: header(outcome, name))
    write_text(folder / "residuals.csv", _csv(outcome))
    write_parquet(folder / "trials.parquet", _trials(outcome), {"fit": plan.name})
    write_text(folder / "summary.md", markdown(outcome))
    write_json(folder / "manifest.json", _manifest(outcome))
    return outcome


def header(outcome: FitOutcome, name: str) -> str:
    """Comment that a calibrated file begins with: what was fitted, to what, and what is left.

    Parameters
    ----------
    outcome : FitOutcome
        With residuals.
    name : str
        Of the file among those of the fit: of a scene only the residuals on it are written.
    """
    plan, draws = outcome.fit, outcome.fit.model.checking
    mine = {cell.name for cell in plan.cells.values() if name in (cell.scene, ROBOT)}
    judged = [one for one in outcome.residuals if one.target.judged]
    lines = [
        f"Calibrated to {one_line(plan.model.source)}; not a validation of them.",
        f"Made by 'uwbbench fit-scene', fit '{plan.name}', {len(outcome.trials)} trials; detector "
        f"{', '.join({cell.detector.name: None for cell in plan.cells.values()})}, {plan.model.scoring} scoring.",
        f"On {len(draws.seeds) * draws.runs} draws that the fit did not see, {len(judged) - len(outcome.missed)} of "
        f"{len(judged)} targets are within their tolerance. Left:",
        *(f"  {line}" for line in _lines(one for one in outcome.residuals if one.target.cell in mine)),
    ]
    wrapped = (part for line in lines for part in wrap(line, _WIDTH - 2, subsequent_indent="  ", drop_whitespace=True))
    return "".join(f"# {line}\n" for line in wrapped)


def _lines(residuals: Iterable[Residual]) -> list[str]:
    """One line a cell and table: every target, and what the calibrated scene gives."""
    rows: dict[tuple[str, str], list[str]] = {}
    for one in residuals:
        text, here = wanted(one)
        mark = "" if one.reached or not one.target.judged else " (out of tolerance)"
        rows.setdefault((one.target.cell, one.target.table), []).append(f"{one.target.metric} {here} for {text}{mark}")
    return [f"{cell}, {table}: {'; '.join(parts)}" for (cell, table), parts in rows.items()]


def _rows(outcome: FitOutcome) -> list[dict[str, Any]]:
    fitted = {one.target: one for one in outcome.fitted}
    return [
        {
            "cell": one.target.cell,
            "table": one.target.table,
            "metric": one.target.metric,
            "target": one.target.value,
            **{kind: getattr(one.target.tolerance, kind) for kind in ("absolute", "relative", "factor")},
            "judged": one.target.judged,
            "value": one.value,
            "low": one.low,
            "high": one.high,
            "difference": one.value - one.target.value,
            "distance": one.distance,
            "reached": one.reached,
            "on_fitted_draws": fitted[one.target].value,
            "draws": list(one.draws),
        }
        for one in outcome.residuals
    ]


def _csv(outcome: FitOutcome) -> str:
    rows = [{**row, "draws": " ".join(f"{value:.6g}" for value in row["draws"])} for row in _rows(outcome)]
    text = io.StringIO()
    writer = DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _trials(outcome: FitOutcome) -> Any:
    """Every trial as an Arrow table."""
    import pyarrow as pa

    about = {name: [getattr(one, name) for one in outcome.trials] for name in ("seed", "stage", "cost")}
    names = outcome.fit.model.parameters
    values = {name: [_storable(one.values[name]) for one in outcome.trials] for name in names}
    return pa.table({**about, **values, "best": [one is outcome.best for one in outcome.trials]})


def _storable(value: Any) -> Any:
    """Number as a float, as a column holds one type; other choices as text."""
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else str(value)


def to_dict(outcome: FitOutcome) -> dict[str, Any]:
    """Results as plain values."""
    return dict(
        plain(
            {
                "fit": outcome.fit.name,
                "source": outcome.fit.model.source,
                "passed": outcome.passed,
                "missed": [one.target.name for one in outcome.missed],
                "values": outcome.best.values,
                "cost": outcome.best.cost,
                "trials": len(outcome.trials),
                "seconds": outcome.seconds,
                "out_of_time": outcome.out_of_time,
                "residuals": _rows(outcome),
            }
        )
    )


def _manifest(outcome: FitOutcome) -> dict[str, Any]:
    plan: Fit = outcome.fit
    search = plan.model.search
    detectors = {cell.detector.name: cell.detector for cell in plan.cells.values()}
    return {
        "format": FORMAT,
        "format_version": VERSION,
        "configuration": {**plan.model.model_dump(mode="json", by_alias=True), "name": plan.name},
        "detectors": {name: Pipeline(config).identity for name, config in detectors.items()},
        "optuna": {"version": version("optuna"), "sampler": search.sampler, "seeds": search.seeds},
        "results": to_dict(outcome),
        "session": session(1),
    }
