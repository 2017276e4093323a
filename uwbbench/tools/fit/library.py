"""A fit from Python, in one call."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from uwbbench.config.given import Given
from uwbbench.tools.fit.config import read_fit
from uwbbench.tools.fit.execute import FitOutcome
from uwbbench.tools.fit.execute import fit as run_fit
from uwbbench.tools.fit.publish import write_outcome
from uwbbench.tools.tune.publish import new_folder


def fit_scene(
    fit: Given,
    out: str | Path,
    *,
    changes: Mapping[str, Any] | None = None,
    progress: Callable[[str], None] | None = None,
) -> FitOutcome:
    """Fit scenes and their robot to known figures, as the command ``fit-scene`` does.

    Parameters
    ----------
    fit : str, Path or mapping
        Shipped name, YAML file, or the values of one.
    out : str or Path
        New folder for the calibrated files, residuals and all trials.
    changes : mapping, optional
        Values to change, by path.
    progress : callable, optional
        Called with what is being done.

    Returns
    -------
    FitOutcome
        ``passed``, and every target beside what the calibrated files give in ``residuals``.

    Raises
    ------
    ConfigError, PluginError
        If the fit is wrong.
    StoreError
        If the folder holds something else, or a file cannot be written.
    """
    plan, say = read_fit(fit, changes), progress or (lambda _: None)
    return write_outcome(run_fit(plan, say), new_folder(plan.name, Path(out)), say)
