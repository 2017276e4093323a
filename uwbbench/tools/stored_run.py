"""A run as an object: its tables, its detections, and its reports and pictures."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from uwbbench.api.errors import ConfigError, nearest
from uwbbench.config.source import data_roots
from uwbbench.results import Report, read_safely
from uwbbench.results.units import unit_of
from uwbbench.run.folder import RunFolder
from uwbbench.show import written

if TYPE_CHECKING:
    import pandas as pd

    from uwbbench.api.arrays import FloatArray
    from uwbbench.api.capture import CaptureHeader
    from uwbbench.api.detections import Detections
    from uwbbench.config.rules import Surface
    from uwbbench.run.folder.verify import Verification

_UNIT = ("kind", "detector", "dataset", "capture", "status", "reason")


class Run:
    """A run folder that was opened: :func:`uwbbench.run` and :func:`uwbbench.open_run` give one.

    Nothing is run, and nothing is read before it is asked for. Tables are pandas DataFrames in SI units, as the names
    of their columns say; NaN is undefined.

    Parameters
    ----------
    folder : str or Path
        Run folder.
    data_dir : str or Path, optional
        First folder in which captures are looked for where their samples are drawn.

    Raises
    ------
    StoreError
        If it is not a run folder, or of a later format.
    """

    def __init__(self, folder: str | Path, data_dir: str | Path | None = None) -> None:
        self.folder = RunFolder(Path(folder))
        self._data_dir = None if data_dir is None else Path(data_dir)

    @property
    def path(self) -> Path:
        """Its folder."""
        return self.folder.path

    @property
    def manifest(self) -> dict[str, Any]:
        """Resolved experiment, versions, hashes and machines, as plain values."""
        return self.folder.manifest

    @cached_property
    def _report(self) -> Report:
        with read_safely(self.path):
            return Report(self.folder)

    # Tables ----------------------------------------------------------------------------------------------------

    @property
    def leaderboard(self) -> pd.DataFrame:
        """One row for each dataset, scoring, table and detector, captures pooled, best first.

        Each metric has its value, the ends of its interval (``f1_low``, ``f1_high``) and the samples behind it
        (``f1_n``). ``source`` says whether the captures are measured or simulated.
        """
        with read_safely(self.path):
            return self._report.leaderboard

    @property
    def scores(self) -> pd.DataFrame:
        """One row for each detector, capture, scoring and table; ``status`` says what could not be scored."""
        with read_safely(self.path):
            return self.folder.scores()

    @property
    def times(self) -> pd.DataFrame:
        """One row for each detector and capture that was timed.

        Times of a frame are in microseconds of the machine that ran the experiment; ``ratio`` is relative to the
        reference detector, with its interval.
        """
        with read_safely(self.path):
            return self._report.latency

    @property
    def units(self) -> pd.DataFrame:
        """What became of each unit: kind, detector, dataset, capture, status (``done``, ``failed``) and reason."""
        import pandas as pd

        rows = [{key: getattr(entry, key) for key in _UNIT} for entry in self.folder.entries()]
        return pd.DataFrame(rows, columns=list(_UNIT))

    @property
    def captures(self) -> pd.DataFrame:
        """What was compared on: dataset, capture, frames, source, licence, citation and description."""
        import pandas as pd

        with read_safely(self.path):
            return pd.DataFrame(self._report.captures)

    @property
    def notes(self) -> list[str]:
        """What detectors want a reader to know."""
        with read_safely(self.path):
            return self._report.notes

    # Units -----------------------------------------------------------------------------------------------------

    def detections(self, detector: str, capture: str, dataset: str | None = None) -> Detections:
        """What a detector found on a capture; ``.to_pandas()`` makes a table of it.

        Parameters
        ----------
        detector, capture : str
            Names, as in :attr:`units`.
        dataset : str, optional
            Needed where captures of several datasets have the same name.

        Raises
        ------
        ConfigError
            If the run has none of that name; names the nearest.
        StoreError
            If nothing was stored.
        """
        with read_safely(self.path):
            return self.folder.detections(unit_of(self.folder, "accuracy", detector, capture, dataset).unit)

    def header(self, capture: str, dataset: str | None = None) -> CaptureHeader:
        """All of a capture but its samples: radar, trajectory and truth.

        Parameters
        ----------
        capture : str
        dataset : str, optional
            Needed where captures of several datasets have the same name.

        Raises
        ------
        ConfigError
            If the run has no capture of that name.
        """
        with read_safely(self.path):
            return self.folder.header(unit_of(self.folder, "accuracy", None, capture, dataset).capture_id)

    def frame_times_us(self, detector: str, capture: str, dataset: str | None = None) -> FloatArray:
        """Time of every call of a latency pass (calls,), in microseconds of the machine that measured it.

        Parameters
        ----------
        detector, capture : str
            Names, as in :attr:`times`.
        dataset : str, optional
            Needed where captures of several datasets have the same name.

        Raises
        ------
        ConfigError
            If the run has none of that name.
        StoreError
            If nothing was timed.
        """
        with read_safely(self.path):
            return self.folder.times_us(unit_of(self.folder, "latency", detector, capture, dataset).unit)

    # What can be done with it ----------------------------------------------------------------------------------

    def report(self, path: str | Path, format: str | None = None, *, force: bool = False) -> Path:  # noqa: A002
        """Write the report, as the command ``report`` does.

        Parameters
        ----------
        path : str or Path
            File; its suffix decides the format.
        format : {"html", "md", "csv", "latex", "json"}, optional
            Another one; ``csv`` writes a folder of tables.
        force : bool
            Replace a file that is no report.

        Raises
        ------
        ConfigError
            If there is no such format.
        StoreError
            If something else is there, or it cannot be written.
        ReportToolsError
            If the libraries that a page needs are not installed.
        """
        target, forms = Path(path), [form.value for form in written.Format]
        if format is not None and format not in forms:
            raise ConfigError(f"no format '{format}'; expected one of {', '.join(forms)}.{nearest(format, forms)}")
        form = written.format_of(target) if format is None else written.Format(format)
        with read_safely(self.path):
            written.write(self._report, target, form, data_roots(self._data_dir), force=force)
        return target

    def figures(self, folder: str | Path, *, force: bool = False) -> list[Path]:
        """Write every chart of the report as PNG, SVG and Vega-Lite.

        Parameters
        ----------
        folder : str or Path
        force : bool
            Write into a folder that holds other files.

        Returns
        -------
        list of Path
            The PNG files.

        Raises
        ------
        StoreError
            If something else is there, or a file cannot be written.
        ReportToolsError
            If the libraries that draw are not installed.
        """
        with read_safely(self.path):
            return written.write_figures(self._report, Path(folder), data_roots(self._data_dir), force=force)

    def rescore(
        self,
        scoring: str | Sequence[str] | None = None,
        gate_m: float | None = None,
        surface: Surface | None = None,
    ) -> None:
        """Score the stored detections again by other rules, and write the reports in the folder anew.

        Parameters
        ----------
        scoring : str or sequence of str, optional
            ``frame``, ``peak``, ``object``; as before by default.
        gate_m : float, optional
            Largest error of a true detection; as before by default.
        surface : {"outline", "visible"}, optional
            What errors of positions are distances to; as before by default.

        Raises
        ------
        ScoringError
            If there is no such scoring, or the gate is no length.
        StoreError
            If stored detections are missing or broken, or the scores cannot be written.
        """
        from uwbbench.run import rescore

        with read_safely(self.path):
            before = self.folder.rules
        names = (
            [rule.scoring for rule in before] if scoring is None else [scoring] if isinstance(scoring, str) else scoring
        )
        changed = {"gate_m": gate_m, "surface": surface}
        rule = dataclasses.replace(before[0], **{key: one for key, one in changed.items() if one is not None})  # type: ignore[arg-type]
        # By name only: an unknown scoring is refused by the rules themselves.
        rules = [dataclasses.replace(rule, scoring=one) for one in dict.fromkeys(names)]  # type: ignore[arg-type]
        with read_safely(self.path):
            rescore(self.folder, rules)
        self.write_reports()

    def write_reports(self) -> str:
        """Write ``report.md`` and ``report.html`` into the folder.

        Returns
        -------
        str
            Why there is no page, where the libraries that make it are not installed; else empty.
        """
        self.__dict__.pop("_report", None)  # of the scores before
        with read_safely(self.path):
            return written.write_into_run(self._report, data_roots(self._data_dir))[1]

    def verify(self) -> Verification:
        """Check that the folder holds what the run wrote, as the command ``verify`` does.

        Returns
        -------
        Verification
            ``passed``, and what does not hold in ``problems``.
        """
        from uwbbench.run.folder.verify import verify

        return verify(self.folder)

    # For people ------------------------------------------------------------------------------------------------

    def __repr__(self) -> str:
        experiment = self.manifest["experiment"]
        units = self.units
        failed = int((units["status"] == "failed").sum())
        captures = len(units.loc[units["kind"] == "accuracy", ["dataset", "capture"]].drop_duplicates())
        text = f"Run('{self.path}': {experiment['name']}, {len(experiment['detectors'])} detectors, {captures} captures"
        return f"{text}, {failed} units failed)" if failed else f"{text})"

    def _repr_html_(self) -> str:
        from uwbbench.show.notebook.run import run

        with read_safely(self.path):
            return run(self._report)
