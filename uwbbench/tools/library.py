"""What the commands do, for scripts and notebooks: each function takes files, names or mappings and gives objects."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from uwbbench.api import registry
from uwbbench.api.capture import Capture
from uwbbench.api.dataset import Dataset
from uwbbench.api.errors import ConfigError
from uwbbench.config.given import Given
from uwbbench.config.rules import Table
from uwbbench.config.source import data_roots
from uwbbench.config.source import open_dataset as opened_dataset
from uwbbench.detect.pipeline import Pipeline, load_detector
from uwbbench.measure.accuracy.metrics.choice import names_of
from uwbbench.tools.leaderboard import Leaderboard, leaderboard
from uwbbench.tools.stored_run import Run

if TYPE_CHECKING:
    from uwbbench.results.comparison import Comparison
    from uwbbench.run import Progress
    from uwbbench.run.experiment import Experiment
    from uwbbench.tools.gate import GateResult
    from uwbbench.tools.tune import TuneOutcome

__all__ = ["Leaderboard", "compare", "gate", "leaderboard", "open_dataset", "open_run", "plot", "run", "tune"]

PICTURES = (".png", ".svg", ".pdf")


def run(
    experiment: Given,
    out: str | Path | None = None,
    *,
    changes: Mapping[str, Any] | None = None,
    data_dir: str | Path | None = None,
    jobs: int | None = None,
    resume: bool = False,
    progress: Callable[[Progress], None] | None = None,
) -> Run:
    """Run an experiment into a run folder, as the command ``run`` does: every detector on every capture.

    A unit (one detector on one capture) that fails is a row of ``Run.units`` with its reason; the others run all the
    same. ``report.md`` and ``report.html`` are written into the folder.

    Parameters
    ----------
    experiment : str, Path or mapping
        Shipped name, YAML file, or the values of one: ``{"detectors": ["paper"], "datasets": [{"use": "approach"}]}``.
    out : str or Path, optional
        New or empty folder; ``runs/NAME-TIME`` by default. With ``resume``, the folder to continue.
    changes : mapping, optional
        Values to change, by path: ``{"gate_m": 0.1}``.
    data_dir : str or Path, optional
        First folder in which datasets are searched.
    jobs : int, optional
        Processes; all usable cores by default.
    resume : bool
        Continue a run that was interrupted.
    progress : callable, optional
        Called with a :class:`uwbbench.run.Progress` after each unit.

    Returns
    -------
    Run

    Raises
    ------
    ConfigError, PluginError
        If the experiment is wrong; the message names file, line and key.
    StoreError
        If results cannot be written, or the folder holds another experiment.
    Interrupted
        If the user interrupts; nothing finished is lost.
    """
    from uwbbench.run import run_experiment
    from uwbbench.run.experiment import read_experiment

    folder = None if data_dir is None else Path(data_dir)
    plan = read_experiment(experiment, changes, folder)
    _check_reach(plan, jobs)
    target = None if out is None else Path(out)
    stored = run_experiment(plan, target, jobs=jobs, resume=resume, progress=progress)
    finished = Run(stored.path, folder)
    if missing := finished.write_reports():
        warnings.warn(missing, stacklevel=2)
    return finished


def _check_reach(plan: Experiment, jobs: int | None) -> None:
    """Refuse to send what only this process knows to others.

    Raises
    ------
    ConfigError
        If a class that was registered here would be needed in another process.
    """
    used: list[tuple[registry.PluginKind, str]] = [
        ("stages", step.use) for config in plan.detectors for step in config.steps
    ]
    used += [("datasets", source.use) for source in plan.datasets] + [
        ("metrics", name) for name in names_of(plan.metrics)
    ]
    for kind, name in used:
        if registry.entry(kind, name).package == registry.HERE_ALONE and (jobs != 1 or plan.latency.enabled):
            raise ConfigError(
                f"{kind[:-1]} '{name}' is registered in this process alone, and other processes are to use it: give "
                "jobs=1 and latency: false, or make a package of it ('uwbbench new')"
            )


def open_run(folder: str | Path, data_dir: str | Path | None = None) -> Run:
    """Open a run folder.

    Parameters
    ----------
    folder : str or Path
    data_dir : str or Path, optional
        First folder in which captures are looked for where their samples are drawn.

    Returns
    -------
    Run

    Raises
    ------
    StoreError
        If it is not a run folder, or of a later format.
    """
    return Run(folder, data_dir)


def open_dataset(
    name: str, params: Mapping[str, Any] | None = None, *, data_dir: str | Path | None = None
) -> Dataset[Any]:
    """Open a dataset; its ``names()`` are captures that its ``open(name)`` gives.

    Parameters
    ----------
    name : str
        Registered name, as in an experiment.
    params : mapping, optional
        Its parameters.
    data_dir : str or Path, optional
        First folder that is searched.

    Raises
    ------
    PluginError, ConfigError
        If there is no such dataset, or a parameter is wrong.

    Examples
    --------
    >>> plates = open_dataset("approach", {"material": "plywood", "speed_m_s": 2.0})
    >>> plates.open(plates.names()[0])
    Capture('approach-ch9-plywood-1', simulated: 68 frames of 50 taps, 1.42 s)
    """
    return opened_dataset(name, params or {}, data_roots(None if data_dir is None else Path(data_dir)))


def compare(
    first: str | Path | Run, second: str | Path | Run, *, scoring: str | None = None, flips: int = 20
) -> Comparison:
    """Compare two runs, as the command ``diff`` does: what went in, then scores, then frames.

    Parameters
    ----------
    first, second : str, Path or Run
        Run folders: before and after. Differences are second minus first.
    scoring : str, optional
        By which frames are compared; the first run's first by default.
    flips : int
        Flipped frames that are listed, the worst first.

    Returns
    -------
    Comparison

    Raises
    ------
    ConfigError
        If the first run was not scored so.
    StoreError
        If something stored is missing or broken.
    """
    from uwbbench.results.comparison import compare as compared

    sides = [one if isinstance(one, Run) else Run(one) for one in (first, second)]
    return compared(sides[0].folder, sides[1].folder, scoring, flips)


def gate(
    gate: Given,
    *,
    changes: Mapping[str, Any] | None = None,
    data_dir: str | Path | None = None,
    progress: Callable[[str], None] | None = None,
) -> GateResult:
    """Check a detector against limits, as the command ``gate`` does.

    Parameters
    ----------
    gate : str, Path or mapping
        Shipped name, YAML file, or the values of one.
    changes : mapping, optional
        Values to change, by path.
    data_dir : str or Path, optional
        First folder in which datasets are searched.
    progress : callable, optional
        Called with what is about to be done.

    Returns
    -------
    GateResult
        ``verdict``, and each of the ``checks`` with value, interval and limit.

    Raises
    ------
    ConfigError, PluginError
        If the gate is wrong; the message names file, line and key.
    """
    from uwbbench.tools.gate import read_gate, run_gate

    checked = read_gate(gate, changes, None if data_dir is None else Path(data_dir))
    return run_gate(checked, progress or (lambda _: None))


def tune(
    tuning: Given,
    out: str | Path | None = None,
    *,
    figure: str | Path | None = None,
    changes: Mapping[str, Any] | None = None,
    data_dir: str | Path | None = None,
    experiment: str | None = None,
    progress: Callable[[str], None] | None = None,
) -> TuneOutcome:
    """Tune a detector's thresholds, as the command ``tune`` does.

    Parameters
    ----------
    tuning : str, Path or mapping
        Shipped name, YAML file, or the values of one.
    out : str or Path, optional
        New folder for tuned detectors, all sets and the manifest; ``tunings/NAME-TIME`` by default.
    figure : str or Path, optional
        Draw the stable zone of a grid there: .png, .svg or .pdf.
    changes : mapping, optional
        Values to change, by path.
    data_dir : str or Path, optional
        First folder in which datasets are searched.
    experiment : str, optional
        Refuse to tune on captures that this experiment scores.
    progress : callable, optional
        Called with what is about to be done.

    Returns
    -------
    TuneOutcome

    Raises
    ------
    ConfigError, PluginError
        If the tuning is wrong, or a figure of a search is asked for.
    StoreError
        If the folder holds something else, or a file cannot be written.
    """
    from uwbbench.tools.tune import new_folder, publish, read_tuning
    from uwbbench.tools.tune import tune as run_tuning

    plan = read_tuning(tuning, changes, None if data_dir is None else Path(data_dir), experiment)
    target = None if figure is None else _picture(figure)
    if target is not None and plan.sweep is None:
        raise ConfigError(f"{target}: a figure shows the stable zone of a grid; a search has none")
    folder = new_folder(plan.name, None if out is None else Path(out))
    outcome = run_tuning(plan, progress or (lambda _: None))
    publish(outcome, folder)
    if target is not None:
        from uwbbench.show.figures import style
        from uwbbench.tools.tune.figure import draw_stable_zone

        style.save(draw_stable_zone(outcome), target)
    return outcome


def plot(
    kind: str,
    source: Capture | Run,
    path: str | Path,
    *,
    detector: str | Pipeline | None = None,
    capture: str | None = None,
    dataset: str | None = None,
    frame: int | None = None,
    scoring: str | None = None,
    gate_m: float | None = None,
    table: Table | None = None,
) -> Path:
    """Draw a picture for print, as the command ``plot`` does; simulated captures are labelled so.

    Parameters
    ----------
    kind : {"cir", "radargram", "properties", "pipeline", "cdf", "map"}
        ``cir`` and ``radargram`` need a capture.
    source : Capture or Run
        A capture is drawn with a detector that runs on it; from a run nothing is run.
    path : str or Path
        Picture to write: .png, .svg or .pdf.
    detector : str or Pipeline, optional
        Detector to run on a capture; name of one of the run's.
    capture, dataset : str, optional
        Which of the run's.
    frame : int, optional
        Of the capture, for ``cir``.
    scoring, table : str, optional
        How detections are counted, and which errors (``filtering`` or ``mapping``), for ``cdf``.
    gate_m : float, optional
        Largest error of a true detection, for ``cdf`` and ``properties``.

    Returns
    -------
    Path
        The picture.

    Raises
    ------
    ConfigError
        If there is no such kind, a choice changes nothing in it, or the kind needs what the source has not.
    StoreError
        If it cannot be written.
    """
    from uwbbench.show.figures import style
    from uwbbench.show.figures.draw import Choices, draw_capture, draw_run

    target, chosen = _picture(path), Choices(frame, scoring, gate_m, table)
    if isinstance(source, Run):
        name = detector.name if isinstance(detector, Pipeline) else detector
        drawn = draw_run(kind, source.folder, chosen, name, capture, dataset)
    else:
        if capture is not None or dataset is not None:
            raise ConfigError("capture and dataset choose from a run; this is a capture")
        pipeline = load_detector(detector) if isinstance(detector, str) else detector
        drawn = draw_capture(kind, source, pipeline, chosen)
    style.save(drawn, target)
    return target


def _picture(path: str | Path) -> Path:
    """Path of a picture whose format is known.

    Raises
    ------
    ConfigError
        If the suffix is that of none.
    """
    if Path(path).suffix.lower() not in PICTURES:
        raise ConfigError(f"{path}: expected a name that ends in {', '.join(PICTURES)}")
    return Path(path)
