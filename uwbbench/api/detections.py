"""What a detector found: a columnar table, one row a detection."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uwbbench.api.arrays import BoolArray, FloatArray, IntArray

if TYPE_CHECKING:
    import pandas as pd

    from uwbbench.api.mapper import Mapped

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
    "track",
    "range_rate_m_s",
    "range_sd_m",
    "range_start_m",
    "range_stop_m",
    "probability",
)
"""Columns of every exported table, in this order; a column that no stage computed is empty there.

``track`` is the number of the confirmed track that a row belongs to, -1 of none; ``range_rate_m_s`` and ``range_sd_m``
are a tracker's. ``range_start_m`` and ``range_stop_m`` bound a segment, whose ``range_m`` lies where it is strongest.
``probability`` says how sure a detector is; a row with it and without a range speaks of its frame as a whole.
"""

HANDED_OUT = "handed_out"
"""Column of :meth:`Detections.with_hand_outs`."""

_INTEGER = ("frame", "cluster", "track", HANDED_OUT)

RECEIVER = "receiver"
"""Column of the rows of a run: place of the receiver among those of the run."""

_Table = tuple[Sequence[str], FloatArray]
"""Names of columns, and the frames and these columns as one array."""


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
        Every peak before the filters, or a function that finds them on demand.
    chain : mapping or callable, optional
        Detections left behind each step of the pipeline, in order, or a function that counts them.
    **columns : (n,) arrays
        Any of :data:`COLUMNS`, and columns of a plugin's own.
    """

    _answered: IntArray | None = None
    _mapped: Mapped | None = None

    def __init__(
        self,
        frame: ArrayLike,
        *,
        processed: ArrayLike | None = None,
        notes: Sequence[str] = (),
        candidates: Detections | Callable[[], Detections] | None = None,
        chain: Mapping[str, int] | Callable[[], Mapping[str, int]] | None = None,
        **columns: ArrayLike,
    ) -> None:
        given: dict[str, NDArray[Any]] = {"frame": np.asarray(frame, dtype=np.int64)}
        for name, values in columns.items():
            given[name] = np.asarray(values, dtype=np.int64 if name in _INTEGER else np.float64)
        if len({len(values) for values in given.values()}) > 1:
            lengths = {name: len(values) for name, values in given.items()}
            raise ValueError(f"detection columns differ in length: {lengths}")
        self._columns: dict[str, NDArray[Any]] | _Table = given
        self._processed: IntArray | tuple[int, BoolArray] = (
            given["frame"] if processed is None else np.asarray(processed, dtype=np.int64)
        )
        self._unsorted = processed is None
        self._notes: Sequence[str] = notes
        self._candidates = candidates
        self._chain = chain

    @classmethod
    def of_table(
        cls,
        names: Sequence[str],
        table: FloatArray,
        processed: tuple[int, BoolArray],
        notes: Sequence[str],
    ) -> Detections:
        """Detections from a table made by compiled code, at hardly any cost until they are read.

        Parameters
        ----------
        names : sequence of str
            Columns behind the frame.
        table : (n, 1 + columns) array
            Whole numbers, such as the frames of the first column, by their bits.
        processed : int and (frames,) bool array
            First frame of the block, and which of its frames were looked at.
        notes : sequence of str
        """
        made = object.__new__(cls)
        made._columns = (names, table)
        made._processed = processed
        made._unsorted = False
        made._notes = notes
        made._candidates = made._chain = None
        return made

    @property
    def columns(self) -> dict[str, NDArray[Any]]:
        """All columns by name, ``frame`` first."""
        if isinstance(self._columns, tuple):
            names, _ = self._columns
            self._columns = {"frame": self.frame, **{name: self[name] for name in names}}
        return self._columns

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all columns, ``frame`` first."""
        return ("frame", *self._columns[0]) if isinstance(self._columns, tuple) else tuple(self._columns)

    @property
    def table(self) -> FloatArray:
        """All columns as one array (n, columns), whole numbers by their bits; not to be changed."""
        if isinstance(self._columns, tuple):
            return self._columns[1]
        made = np.empty((len(self), len(self._columns)))
        for place, values in enumerate(self._columns.values()):
            made[:, place] = values.view(np.float64)
        return made

    @property
    def processed(self) -> IntArray:
        """Indices of all frames that a detector has looked at (m,)."""
        if isinstance(self._processed, tuple):
            first, looked_at = self._processed
            self._processed = first + np.flatnonzero(looked_at)
        if self._unsorted:
            self._processed, self._unsorted = np.unique(self._processed), False
        return self._processed

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader of the results must know."""
        return tuple(self._notes)

    @property
    def chain(self) -> dict[str, int]:
        """Detections left behind each step of the pipeline, in order; counted on demand."""
        if callable(self._chain):
            self._chain = self._chain()
        return dict(self._chain or {})

    @classmethod
    def empty(cls, processed: ArrayLike = (), notes: Sequence[str] = ()) -> Detections:
        """No detection, although the frames ``processed`` were looked at."""
        return cls(np.empty(0, np.int64), processed=processed, notes=notes)

    def __len__(self) -> int:
        return len(self._columns[1] if isinstance(self._columns, tuple) else self._columns["frame"])

    def __repr__(self) -> str:
        return f"Detections({len(self)} in {len(self.processed)} frames: {', '.join(self.columns)})"

    def _repr_html_(self) -> str:
        from uwbbench.show.notebook.detections import detections

        return detections(self)

    def __contains__(self, column: str) -> bool:
        return column in self.columns

    def __getitem__(self, column: str) -> NDArray[Any]:
        """Column by name; NaN throughout where no stage computed it."""
        if isinstance(self._columns, tuple) and column in self._columns[0]:
            values: NDArray[Any] = self._columns[1][:, 1 + self._columns[0].index(column)]
            return values.view(np.int64) if column in _INTEGER else values
        known = self.columns.get(column)
        return np.full(len(self), np.nan) if known is None else known

    @property
    def frame(self) -> IntArray:
        """Frame index of each detection (n,)."""
        if isinstance(self._columns, tuple):
            return self._columns[1].view(np.int64)[:, 0]
        return self._columns["frame"]

    @property
    def range_m(self) -> FloatArray:
        """Range from receiver to target (n,)."""
        return self["range_m"]

    @property
    def azimuth_rad(self) -> FloatArray:
        """Azimuth at the receiver from boresight, positive left (n,)."""
        return self["azimuth_rad"]

    @property
    def answered(self) -> IntArray | None:
        """Frame (m,) after whose step each of ``processed`` was first named; None where that is not known.

        A frame that was named only at the end has the number of frames of its capture.
        """
        return self._answered

    @property
    def mapped(self) -> Mapped | None:
        """Poses and map that a mapper made of these rows, those of all its front ends; None of a plain detector."""
        return self._mapped

    @property
    def candidates(self) -> Detections | None:
        """Every peak before the filters, found on demand; None where the detector does not give them."""
        if callable(self._candidates):
            self._candidates = self._candidates()
        return self._candidates

    def with_columns(self, **columns: ArrayLike) -> Detections:
        """Return the same detections with columns added or replaced."""
        added = {
            name: np.asarray(values, dtype=np.int64 if name in _INTEGER else np.float64)
            for name, values in columns.items()
        }
        wrong = {name: len(values) for name, values in added.items() if len(values) != len(self)}
        if wrong:
            raise ValueError(f"detection columns differ in length: {len(self)} rows, but {wrong}")
        return self._with({**self.columns, **added})

    def with_hand_outs(self, handed_out: ArrayLike, answered: ArrayLike) -> Detections:
        """Return the same detections with the time at which each was known, counted in frames of the stream.

        Parameters
        ----------
        handed_out : (n,) int array
            Index of the frame after whose step each detection was handed out; the number of frames of the capture for
            one that came only at the end. Becomes the column ``handed_out``.
        answered : (m,) int array
            The same for each of the processed frames: when the detector first named it as processed.
        """
        made = self.with_columns(**{HANDED_OUT: handed_out})
        made._answered = np.asarray(answered, dtype=np.int64)
        if len(made._answered) != len(made.processed):
            raise ValueError(f"{len(made._answered)} frames answered, but {len(made.processed)} processed")
        return made

    def take(self, rows: BoolArray | IntArray) -> Detections:
        """Return the rows of a mask or an index array; the processed frames stay."""
        return self._with({name: values[rows] for name, values in self.columns.items()})

    def annotated(
        self,
        *,
        processed: IntArray | tuple[int, BoolArray] | None = None,
        notes: Sequence[str] | None = None,
        candidates: Detections | Callable[[], Detections] | None = None,
        chain: Mapping[str, int] | Callable[[], Mapping[str, int]] | None = None,
        mapped: Mapped | None = None,
    ) -> Detections:
        """Return the same rows with other facts about them; what is not given stays.

        Parameters
        ----------
        processed : (m,) int array, or int and (frames,) bool array, optional
            Indices of the frames that a detector has looked at, rising; or the first frame of a block and a mask of its
            frames.
        notes : sequence of str, optional
            What a reader of the results must know; replaces the notes there are.
        candidates : Detections or callable, optional
            Every peak before the filters, or a function that finds them on demand.
        chain : mapping or callable, optional
            Detections left behind each step of the pipeline, in order, or a function that counts them.
        mapped : Mapped, optional
            Poses and map that a mapper made of these rows.
        """
        made = self._with(self._columns)
        if processed is not None:
            made._processed, made._unsorted, made._answered = processed, False, None
        if notes is not None:
            made._notes = notes
        if candidates is not None:
            made._candidates = candidates
        if chain is not None:
            made._chain = chain
        if mapped is not None:
            made._mapped = mapped
        return made

    def _with(self, columns: dict[str, NDArray[Any]] | _Table) -> Detections:
        """Detections of checked columns with the same facts about them."""
        made = object.__new__(Detections)
        made._columns = columns
        made._processed, made._unsorted = self._processed, self._unsorted
        made._notes, made._candidates, made._chain = self._notes, self._candidates, self._chain
        made._answered, made._mapped = self._answered, self._mapped
        return made

    @staticmethod
    def join(parts: Sequence[Detections]) -> Detections:
        """Stack tables; a column that only some of them computed is NaN (cluster and track: -1) in the others."""
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

    def records(self) -> list[dict[str, Any]]:
        """Rows as plain values, one mapping of column to number for each: what a program without arrays reads.

        Examples
        --------
        >>> Detections([4], range_m=[2.5]).records()
        [{'frame': 4, 'range_m': 2.5}]
        """
        if not len(self):
            return []
        if isinstance(self._columns, tuple):
            names, table = ("frame", *self._columns[0]), self._columns[1]
            values = table.tolist()
            for place in _whole_places(names):
                for row, whole in zip(values, table.view(np.int64)[:, place].tolist(), strict=True):
                    row[place] = whole
            return [dict(zip(names, row, strict=True)) for row in values]
        columns = [values.tolist() for values in self._columns.values()]
        return [dict(zip(self._columns, row, strict=True)) for row in zip(*columns, strict=True)]

    def to_pandas(self) -> pd.DataFrame:
        """Table with :data:`COLUMNS` first, then columns of plugins.

        ``cluster`` and ``track`` are nullable integers: -1 is noise or no track, missing means that no stage made any.
        """
        import pandas as pd

        extra = [name for name in self.columns if name not in COLUMNS]
        table = pd.DataFrame({name: self[name] for name in (*COLUMNS, *extra)})
        return table.astype({"cluster": "Int64", "track": "Int64"})


@lru_cache(maxsize=64)
def _whole_places(names: tuple[str, ...]) -> tuple[int, ...]:
    """Which of some columns hold whole numbers; kept, as a stream asks for it in every frame."""
    return tuple(place for place, name in enumerate(names) if name in _INTEGER)
