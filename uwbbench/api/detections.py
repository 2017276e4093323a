"""What a detector found: a columnar table, one row a detection."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uwbbench.api.arrays import BoolArray, FloatArray, IntArray

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = (
    "frame",
    "delay_s",
    "range_m",
    "azimuth_rad",
    "amplitude",
    "score_db",
    "x_m",
    "y_m",
    "cluster",
    "tap",
    "prominence",
    "width_taps",
    "pdoa_rad",
)
"""Columns of every exported table, in this order; a column nobody computed is empty there."""

_INTEGER = ("frame", "cluster")


class Detections:
    """Detections as a struct of arrays.

    A frame that was processed and holds nothing differs from a frame that was never processed: ``processed`` lists the
    former. Absent columns were not computed; they read as NaN.

    Parameters
    ----------
    frame : (n,) int array
        Index of the frame of each detection.
    processed : (m,) int array, optional
        Indices of all frames that a detector has looked at; by default those that have a detection.
    notes : sequence of str
        What a reader of the results must know, for example stages left out.
    candidates : Detections or callable, optional
        Every peak before the filters, or a function that finds them when somebody asks.
    chain : mapping, optional
        Detections left behind each step of the pipeline, in order.
    **columns : (n,) arrays
        Any of :data:`COLUMNS`, and columns of a plugin's own.
    """

    def __init__(
        self,
        frame: ArrayLike,
        *,
        processed: ArrayLike | None = None,
        notes: Sequence[str] = (),
        candidates: Detections | Callable[[], Detections] | None = None,
        chain: Mapping[str, int] | None = None,
        **columns: ArrayLike,
    ) -> None:
        self.columns: dict[str, NDArray[Any]] = {"frame": np.asarray(frame, dtype=np.int64)}
        for name, values in columns.items():
            self.columns[name] = np.asarray(values, dtype=np.int64 if name in _INTEGER else np.float64)
        lengths = {name: len(values) for name, values in self.columns.items()}
        if len(set(lengths.values())) > 1:
            raise ValueError(f"detection columns differ in length: {lengths}")
        seen = np.unique(self.frame) if processed is None else np.asarray(processed, dtype=np.int64)
        self.processed: IntArray = seen
        self.notes: tuple[str, ...] = tuple(notes)
        self.chain: dict[str, int] = dict(chain or {})
        self._candidates = candidates

    @classmethod
    def empty(cls, processed: ArrayLike = (), notes: Sequence[str] = ()) -> Detections:
        """No detection, although the frames ``processed`` were looked at."""
        return cls(np.empty(0, np.int64), processed=processed, notes=notes)

    def __len__(self) -> int:
        return len(self.frame)

    def __repr__(self) -> str:
        return f"Detections({len(self)} in {len(self.processed)} frames: {', '.join(self.columns)})"

    def __contains__(self, column: str) -> bool:
        return column in self.columns

    def __getitem__(self, column: str) -> NDArray[Any]:
        """Column by name; NaN throughout where nobody computed it."""
        found = self.columns.get(column)
        return np.full(len(self), np.nan) if found is None else found

    @property
    def frame(self) -> IntArray:
        """Frame index of each detection (n,)."""
        return self.columns["frame"]

    @property
    def range_m(self) -> FloatArray:
        """Range from receiver to target (n,)."""
        return self["range_m"]

    @property
    def azimuth_rad(self) -> FloatArray:
        """Azimuth at the receiver from boresight, positive left (n,)."""
        return self["azimuth_rad"]

    @property
    def candidates(self) -> Detections | None:
        """Every peak before the filters, found on demand; None where the detector cannot tell."""
        if callable(self._candidates):
            self._candidates = self._candidates()
        return self._candidates

    def with_columns(self, **columns: ArrayLike) -> Detections:
        """Return the same detections with columns added or replaced."""
        return self._with({**self.columns, **columns})

    def take(self, rows: BoolArray | IntArray) -> Detections:
        """Return the rows of a mask or an index array; the processed frames stay."""
        return self._with({name: values[rows] for name, values in self.columns.items()})

    def annotated(
        self,
        *,
        processed: ArrayLike | None = None,
        notes: Sequence[str] | None = None,
        candidates: Detections | Callable[[], Detections] | None = None,
        chain: Mapping[str, int] | None = None,
    ) -> Detections:
        """Return the same rows with other facts about them; what is not given stays."""
        facts: dict[str, Any] = self.columns
        return Detections(
            **facts,
            processed=self.processed if processed is None else processed,
            notes=self.notes if notes is None else notes,
            candidates=self._candidates if candidates is None else candidates,
            chain=self.chain if chain is None else chain,
        )

    def _with(self, columns: Mapping[str, ArrayLike]) -> Detections:
        facts: dict[str, Any] = dict(columns)
        return Detections(
            **facts, processed=self.processed, notes=self.notes, candidates=self._candidates, chain=self.chain
        )

    @staticmethod
    def join(parts: Sequence[Detections]) -> Detections:
        """Stack tables; a column that only some of them computed is NaN (cluster: -1) in the others."""
        names: list[str] = []
        for part in parts:
            names += [name for name in part.columns if name not in names and name != "frame"]
        columns = {
            name: np.concatenate(
                [part.columns.get(name, np.full(len(part), -1 if name in _INTEGER else np.nan)) for part in parts]
            )
            for name in names
        }
        notes = tuple(dict.fromkeys(note for part in parts for note in part.notes))
        frame = np.concatenate([part.frame for part in parts]) if parts else np.empty(0, np.int64)
        seen = np.unique(np.concatenate([part.processed for part in parts])) if parts else np.empty(0, np.int64)
        facts: dict[str, Any] = columns
        return Detections(frame, processed=seen, notes=notes, **facts)

    def to_pandas(self) -> pd.DataFrame:
        """Table with :data:`COLUMNS` first, then columns of plugins.

        ``cluster`` is a nullable integer: -1 is noise, missing means that no clustering ran.
        """
        import pandas as pd

        extra = [name for name in self.columns if name not in COLUMNS]
        table = pd.DataFrame({name: self[name] for name in (*COLUMNS, *extra)})
        return table.astype({"cluster": "Int64"})
