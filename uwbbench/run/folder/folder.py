"""A run folder: everything one experiment gave, enough to score and report it again without running anything.

==============================  ==========================================================================
``manifest.json``               resolved configuration, versions, hashes, environment, command; sealed at the end
``journal.jsonl``               one line for each finished unit
``detections/UNIT.parquet``     what a detector found on a capture
``candidates/UNIT.parquet``     peaks before the filters, where ``peak`` scoring was asked for
``curves/UNIT.parquet``        what it would find at every threshold of its score
``poses/UNIT.parquet``          poses of a mapper on a run, on the way and smoothed
``maps/UNIT.npz``               its map, as named arrays
``captures/ID.json, .parquet``  a capture without its samples: radar, poses, truth
``times/UNIT.parquet``          time of every call of a latency pass
``scores.parquet``              one row for each detector, capture, scoring and table
``report.md``                   the tables for people
==============================  ==========================================================================
"""

from __future__ import annotations

import dataclasses
import hashlib
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from uwbbench.api.arrays import FloatArray
from uwbbench.api.capture import CaptureHeader
from uwbbench.api.detections import Detections
from uwbbench.api.errors import StoreError
from uwbbench.api.mapper import Mapped
from uwbbench.config.detector import REFERENCE
from uwbbench.measure.accuracy.ranked import RankedCounts
from uwbbench.measure.accuracy.scoring import ScoringRules
from uwbbench.run.folder import journal, mapped, tables
from uwbbench.run.folder.files import disk_errors, read_json, read_parquet, write_json, write_parquet, write_text
from uwbbench.run.folder.identity import digest, plain
from uwbbench.run.folder.journal import Entry

if TYPE_CHECKING:
    import pandas as pd

FORMAT = "uwbbench-run"
VERSION = 1


class RunFolder:
    """Writer and reader of one run folder.

    Parameters
    ----------
    path : Path
        Folder that :meth:`create` made.

    Raises
    ------
    StoreError
        If it is not a run folder, or of a later format.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        if not (path / "manifest.json").is_file():
            raise StoreError(f"{path}: is not a run folder: no manifest.json in it")
        manifest = read_json(path / "manifest.json")
        known = isinstance(manifest, dict) and (manifest.get("format"), manifest.get("format_version"))
        if known != (FORMAT, VERSION):
            raise StoreError(
                f"{path / 'manifest.json'}: expected {FORMAT} version {VERSION}, found {known or 'no keys'}"
            )
        self.manifest: dict[str, Any] = manifest

    @classmethod
    def create(cls, path: Path, manifest: Mapping[str, Any]) -> RunFolder:
        """Make a run folder.

        Raises
        ------
        StoreError
            If the folder exists and holds anything, or cannot be written.
        """
        with disk_errors(path, "made"):
            if path.exists() and (not path.is_dir() or any(path.iterdir())):
                raise StoreError(f"{path}: already exists and is not empty; give another folder, or resume that run")
            path.mkdir(parents=True, exist_ok=True)
        write_json(path / "manifest.json", {"format": FORMAT, "format_version": VERSION, **manifest})
        return cls(path)

    def scene(self, dataset: str, capture: str) -> str:
        """Scene or set-up that a capture is of: its own name, unless the run knows which captures repeat it."""
        return str(self.manifest.get("scenes", {}).get(dataset, {}).get(capture, capture))

    @property
    def bounds(self) -> frozenset[str]:
        """Names of those that are no detectors, but bound what detectors can reach.

        Runs of earlier versions do not say it; in these, they are those whose files call them references.
        """
        detectors = self.manifest["experiment"]["detectors"]
        references = [config["name"] for config in detectors if config.get("fidelity") == REFERENCE]
        return frozenset(self.manifest.get("bounds", references))

    def update_manifest(self, **values: Any) -> None:
        """Replace top-level values of the manifest, and break its seal: more results are to come."""
        kept = {key: value for key, value in self.manifest.items() if key not in ("files", "seal")}
        self._write_manifest({**kept, **values})

    def _write_manifest(self, values: Mapping[str, Any]) -> None:
        manifest = plain(values)
        write_json(self.path / "manifest.json", manifest)
        self.manifest = manifest

    # Seal ------------------------------------------------------------------------------------------------------

    def seal(self) -> None:
        """Say that the run has ended: note the hash of every file of results, and of the manifest itself."""
        self._seal({name: self.hash_of(name) for name in self.result_files()})

    @property
    def sealed(self) -> bool:
        """Whether the run has ended."""
        return "seal" in self.manifest

    @property
    def intact(self) -> bool:
        """Whether the manifest of a run that has ended is as it was then."""
        return bool(digest({k: v for k, v in self.manifest.items() if k != "seal"}) == self.manifest["seal"])

    def _seal(self, files: Mapping[str, str]) -> None:
        self.update_manifest(files=files)
        self._write_manifest({**self.manifest, "seal": digest(self.manifest)})

    def result_files(self) -> list[str]:
        """Files that hold results, by their path in the folder; reports are made of these."""
        folders = ("captures", "detections", "candidates", "poses", "maps", "curves", "times")
        with disk_errors(self.path, "read"):
            files = [path for name in folders for path in (self.path / name).glob("*") if path.is_file()]
            files += [path for name in ("journal.jsonl", "scores.parquet") if (path := self.path / name).is_file()]
        return sorted(path.relative_to(self.path).as_posix() for path in files)

    def hash_of(self, name: str) -> str:
        """SHA-256 of a file in the folder."""
        with disk_errors(self.path / name, "read"), (self.path / name).open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()

    # Units -----------------------------------------------------------------------------------------------------

    def record(self, entry: Entry) -> None:
        """Journal a unit. Whatever belongs to it has been written before, so that a journalled unit is complete."""
        journal.append(self.path / "journal.jsonl", entry)

    def entries(self) -> list[Entry]:
        """Last entry of each unit, in the order they first finished."""
        return list(journal.read(self.path / "journal.jsonl")[0].values())

    @property
    def damage(self) -> list[str]:
        """What could not be read of the journal."""
        return journal.read(self.path / "journal.jsonl")[1]

    def write_detections(self, unit: str, detections: Detections, candidates: Detections | None) -> None:
        """Store what a detector found, and the peaks before its filters where they are known.

        Parameters
        ----------
        unit : str
            Identifier of the unit.
        detections : Detections
        candidates : Detections or None
            The peaks before the filters; None where nobody asked for them.
        """
        tables.write_detections(self._file("detections", unit), detections)
        if candidates is not None:
            tables.write_detections(self._file("candidates", unit), candidates)

    def detections(self, unit: str) -> Detections:
        """Read what a detector found, with the candidates, and with the poses and the map, if they were stored."""
        candidates = self._file("candidates", unit)
        found = tables.read_detections(self._file("detections", unit), candidates if candidates.is_file() else None)
        map_ = self._map(unit)
        if not (self.has_poses(unit) or map_.is_file()):
            return found
        return found.annotated(mapped=mapped.read_mapped(self._file("poses", unit), map_))

    def has_poses(self, unit: str) -> bool:
        """Whether poses of a mapper are stored."""
        return self._file("poses", unit).is_file()

    def write_mapped(self, unit: str, made: Mapped | None, time_s: FloatArray) -> None:
        """Store poses and map of a mapper, in place of what an earlier session stored.

        Parameters
        ----------
        unit : str
            Identifier of the unit.
        made : Mapped or None
            None of a plain detector.
        time_s : (steps,) array
            Of the run.
        """
        poses, map_ = self._file("poses", unit), self._map(unit)
        if made is not None:
            mapped.write_mapped(poses, map_, made, time_s)
            return
        for path in (poses, map_):
            with disk_errors(path, "removed"):
                path.unlink(missing_ok=True)

    def write_curve(self, unit: str, counts: RankedCounts | None, rules: ScoringRules) -> None:
        """Store what a detector would find at every threshold of its score, in place of what an earlier session stored.

        Parameters
        ----------
        unit : str
            Identifier of the unit.
        counts : RankedCounts or None
            None where they are not known.
        rules : ScoringRules
            Their gate and region gave the counts.
        """
        path = self._file("curves", unit)
        if counts is None:
            with disk_errors(path, "removed"):
                path.unlink(missing_ok=True)
        else:
            tables.write_curve(path, counts, curve_rules(rules))

    def curve(self, unit: str, rules: ScoringRules) -> RankedCounts | None:
        """What a detector would find at every threshold; None where that is not known for this gate and region."""
        path = self._file("curves", unit)
        if not path.is_file():
            return None
        counts, stored = tables.read_curve(path)
        return counts if stored == curve_rules(rules) else None

    # Captures --------------------------------------------------------------------------------------------------

    def write_header(self, capture_id: str, header: CaptureHeader, sha256: str) -> None:
        """Store all of a capture but its samples, unless the same content is there already.

        Parameters
        ----------
        capture_id : str
            Identifier of the capture in this folder.
        header : CaptureHeader
        sha256 : str
            Of the content, samples included.
        """
        stem = self.path / "captures" / _safe(capture_id)
        if not stem.with_suffix(".json").is_file() or self.content(capture_id) != sha256:
            tables.write_header(stem, header, sha256)

    def header(self, capture_id: str) -> CaptureHeader:
        """Read a capture without its samples."""
        return tables.read_header(self.path / "captures" / _safe(capture_id))

    def content(self, capture_id: str) -> str:
        """SHA-256 of the content of a stored capture."""
        return str(read_json(self.path / "captures" / f"{_safe(capture_id)}.json")["sha256"])

    # Times -----------------------------------------------------------------------------------------------------

    def write_times(
        self, unit: str, times_us: FloatArray, latency: Mapping[str, Any], step_us: FloatArray | None = None
    ) -> None:
        """Store the time of every call of a latency pass, and its summary.

        Parameters
        ----------
        unit : str
            Identifier of the unit.
        times_us : (calls,) array
            Of what the summary says under ``timed``.
        latency : mapping
            Summary as plain values.
        step_us : (calls,) array, optional
            Time of the detector's step alone in each call.
        """
        import pyarrow as pa

        columns = {"time_us": times_us} | ({} if step_us is None else {"step_us": step_us})
        write_parquet(self._file("times", unit), pa.table(columns), latency)

    def times_us(self, unit: str) -> FloatArray:
        """Time of every call (frames,) of a latency pass, from samples to rows; in older runs of the step alone."""
        table, _ = read_parquet(self._file("times", unit))
        return np.asarray(table.column("time_us").to_numpy(), dtype=np.float64)

    def step_times_us(self, unit: str) -> FloatArray:
        """Time of the detector's step alone in every call (frames,) of a latency pass."""
        table, _ = read_parquet(self._file("times", unit))
        name = "step_us" if "step_us" in table.column_names else "time_us"
        return np.asarray(table.column(name).to_numpy(), dtype=np.float64)

    # Scores and report -----------------------------------------------------------------------------------------

    def write_scores(self, rows: Sequence[Mapping[str, Any]], rules: Sequence[ScoringRules]) -> None:
        """Store the scores, with the rules that gave them; replaces earlier ones."""
        import pyarrow as pa

        names = list(dict.fromkeys(name for row in rows for name in row))
        columns = {name: [_encodable(row.get(name)) for row in rows] for name in names}
        facts = {"rules": [rule.to_dict() for rule in rules]}
        write_parquet(self._scores, pa.table(columns), facts)
        if self.sealed:  # the other files keep the hashes that they had when the run ended
            self._seal({**self.manifest["files"], self._scores.name: self.hash_of(self._scores.name)})

    def scores(self) -> pd.DataFrame:
        """Scores of every detector, capture, scoring and table; failed units are rows too.

        Raises
        ------
        StoreError
            If there are none yet: the run was killed before it ended.
        """
        frame: pd.DataFrame = self._read_scores()[0].to_pandas()
        return frame

    @property
    def rules(self) -> list[ScoringRules]:
        """Rules that the stored scores follow."""
        stored = self._read_scores()[1]["rules"]
        return [ScoringRules.from_dict(rule) for rule in stored]

    @property
    def _scores(self) -> Path:
        return self.path / "scores.parquet"

    def _read_scores(self) -> tuple[Any, Any]:
        if not self._scores.is_file():
            raise StoreError(
                f"{self.path}: holds no scores: the run did not end; continue it with --resume {self.path}"
            )
        return read_parquet(self._scores)

    def write_text(self, name: str, text: str) -> Path:
        """Write a text file such as ``report.md`` into the folder."""
        write_text(self.path / name, text)
        return self.path / name

    def _map(self, unit: str) -> Path:
        return self._file("maps", unit).with_suffix(".npz")

    def _file(self, kind: str, unit: str) -> Path:
        return self.path / kind / f"{_safe(unit)}.parquet"


def curve_rules(rules: ScoringRules) -> dict[str, Any]:
    """Gate and region, all that curves depend on, as plain values."""
    return {"gate_m": rules.gate_m, "region": dataclasses.asdict(rules.region)}


def _safe(identifier: str) -> str:
    """Identifier as part of a file name; a journal edited by hand must not lead out of its folder."""
    if not re.fullmatch(r"[\w-]{1,64}", identifier, flags=re.ASCII):
        raise StoreError(f"expected the identifier of a unit or a capture, found {identifier[:80]!r}")
    return identifier


def _encodable(value: Any) -> Any:
    """Value that Parquet can hold: file names may hold bytes that are no text."""
    return value.encode("utf-8", "backslashreplace").decode() if isinstance(value, str) else value
