"""A detector assembled from stages: the same code as a batch and as a stream."""

from __future__ import annotations

import contextlib
import hashlib
import json
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from uwbbench import registry
from uwbbench.api.block import Block
from uwbbench.api.capture import Capture, CaptureHeader
from uwbbench.api.detections import COLUMNS, Detections
from uwbbench.api.errors import ConfigError, PluginError
from uwbbench.api.frames import Frames
from uwbbench.api.stage import Filter, Stage
from uwbbench.config.detector import DetectorConfig, detector_from_text, read_detector

BATCH_FRAMES = 4096
"""Frames a block of :meth:`Pipeline.run`: large enough to be fast, small enough for a million frames."""

_NEEDS = {
    "sts": "STS responses of two antennas",
    "truth": "ground truth",
    "first_path": "reported first path",
}


@dataclass(frozen=True)
class _Opened:
    label: str
    stage: Stage[Any]


class Stream:
    """A detector at work on one receiver, block by block.

    Made by :meth:`Pipeline.open`; not shared between threads.
    """

    def __init__(self, stages: list[_Opened], notes: list[str], *, audit: bool = False) -> None:
        self._stages = stages
        self._notes = notes
        self._audit = audit
        self._rejected: list[Detections] = []
        self.chain: dict[str, int] = {}

    def step(self, frames: Frames) -> Detections:
        """Detections that are ready after these frames.

        Parameters
        ----------
        frames : Frames
            The next consecutive frames, one or many.

        Returns
        -------
        Detections
            Usually of these frames; of earlier ones behind a stage that holds detections back.
        """
        return self._emit(self._through(Block(_without_invalid(frames)), 0))

    def flush(self) -> Detections:
        """Detections that were still held back; ends the stream."""
        return Detections.join([self._emit(tail) for tail in self._tails()]).annotated(notes=self.notes)

    @property
    def ports(self) -> frozenset[str]:
        """All that the stages produce."""
        return frozenset().union(*(stage.produces for stage in self.stages))

    @property
    def stages(self) -> tuple[Stage[Any], ...]:
        """The stages at work, in order."""
        return tuple(opened.stage for opened in self._stages)

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader of the results must know, so far."""
        return tuple(dict.fromkeys([*self._notes, *(note for o in self._stages for note in o.stage.notes)]))

    @property
    def rejected(self) -> Detections:
        """Detections that filters dropped, kept only in an audit.

        ``rejected_by`` is the place of the filter in ``chain``.
        """
        return Detections.join(self._rejected)

    def _tails(self) -> Iterator[Block]:
        """What stages still hold back, each taken through the stages behind it."""
        for index, opened in enumerate(self._stages):
            tail = opened.stage.flush()
            if tail is not None:
                tail = _without_rows_of_invalid(tail)
                if opened.label in self.chain:
                    self.chain[opened.label] += len(tail.detections)
                yield self._through(tail, index + 1)

    def _emit(self, block: Block) -> Detections:
        return block.detections.annotated(processed=block.frames.index[block.frames.valid], notes=self.notes)

    def _through(self, block: Block, start: int) -> Block:
        rejected: list[Block] = []
        for opened in self._stages[start:]:
            stage = opened.stage
            if self._audit and isinstance(stage, Filter):
                keep = stage.keep(block)
                dropped = block.detections.take(~keep)
                place = np.full(len(dropped), self._place(opened.label))
                rejected.append(block.replace(detections=dropped.with_columns(rejected_by=place)))
                block = block.replace(detections=block.detections.take(keep))
            else:
                if stage.rowwise:
                    rejected = [stage.step(part) for part in rejected]
                block = stage.step(block)
                rejected = [_brought_along(part, block) for part in rejected]
            if "detections" in stage.produces:
                block = _without_rows_of_invalid(block)
            if "detections" in stage.produces or self.chain:
                self.chain[opened.label] = self.chain.get(opened.label, 0) + len(block.detections)
        self._rejected += [part.detections for part in rejected]
        return block

    def _place(self, label: str) -> int:
        """Place of a step in the chain, where it stands from its first block on."""
        return list(self.chain).index(label) if label in self.chain else len(self.chain)


class Pipeline:
    """A detector: stages with checked ports.

    Parameters
    ----------
    config : DetectorConfig
        Validated detector file.

    Raises
    ------
    ConfigError
        If a stage uses what no earlier stage produces.
    """

    def __init__(self, config: DetectorConfig) -> None:
        self.config = config
        self._check_ports()

    @property
    def name(self) -> str:
        """Name in tables and reports."""
        return self.config.name

    def __repr__(self) -> str:
        return f"Pipeline({self.name}: {' -> '.join(step.label for step in self.config.steps)})"

    def _check_ports(self) -> None:
        available = {"frames"}
        makers: dict[str, str] = {}
        for step in self.config.steps:
            for port in registry.load("stages", step.use).produces:
                makers.setdefault(port, step.label)
        for step in self.config.steps:
            stage = registry.load("stages", step.use)
            for port in sorted(stage.consumes - available):
                if port in makers:
                    hint = f"step '{makers[port]}' makes it, but stands later, or its result is gone by then"
                else:
                    hint = (
                        f"no step makes it; put one of these before it: {', '.join(_makers_of(port)) or 'none known'}"
                    )
                place = f"{step.place}: " if step.place else ""
                raise ConfigError(f"{place}detector '{self.name}': step '{step.label}' needs '{port}': {hint}")
            available = (available - stage.removes) | stage.produces
        if "detections" not in available:
            raise ConfigError(f"detector '{self.name}': no step produces detections")

    def open(self, capture: CaptureHeader, *, audit: bool = False) -> Stream:
        """Start a stream on a receiver.

        Parameters
        ----------
        capture : Capture or CaptureHeader
            Gives the radar; its samples are not touched.
        audit : bool
            Keep what the filters drop, in ``stream.rejected``.

        Raises
        ------
        ConfigError
            If the capture lacks what a stage needs and the stage is not optional.
        """
        radar = capture.radar
        counted_from_transmission = radar.first_tap_delay_s is not None
        has = {
            name
            for name, there in (
                ("sts", radar.has_sts),
                ("truth", capture.truth is not None),
                ("first_path", radar.has_first_path or counted_from_transmission),
            )
            if there
        }
        available = {"frames"}
        stages, notes = [], []
        missing: dict[str, str] = {}  # port that a step left out would have made: what the capture lacks for it
        left_out: dict[str, list[str]] = {}
        for step in self.config.steps:
            cls = registry.load("stages", step.use)
            params, fallen = step.params_for(radar.channel)
            if step.implied_by:
                notes.append(f"{step.label}: put before '{step.implied_by}', which needs it, with its defaults")
            given = f"channel {radar.channel}" if radar.channel else "a capture without channel"
            notes += [f"{step.label}: no {name} for {given}, used {params[name]}" for name in fallen]
            lacks = [_NEEDS.get(need, need) for need in sorted(cls.needs - has)]
            lacks += [missing.get(port, port) for port in sorted(cls.consumes - available)]
            lacks = list(dict.fromkeys(lacks))
            if lacks and step.optional:
                reason = ", no ".join(lacks)
                left_out.setdefault(reason, []).append(step.label)
                missing |= dict.fromkeys(cls.produces, reason)
                continue
            if lacks:
                where = f"detector '{self.name}', step '{step.label}'"
                raise ConfigError(f"{where}: capture '{capture.name}' has no {', no '.join(lacks)}")
            stage: Stage[Any] = cls(cls.params_type().model_validate(params))
            stage.open(radar)
            if "truth" in cls.needs and capture.truth is not None:
                stage.show_truth(capture.truth, capture.trajectory)
            available = (available - stage.removes) | stage.produces
            stages.append(_Opened(step.label, stage))
        notes += [f"left out, as the capture has no {reason}: {', '.join(names)}" for reason, names in left_out.items()]
        return Stream(stages, notes, audit=audit)

    def run(self, capture: Capture, *, candidates: bool = False) -> Detections:
        """Detect on a whole capture.

        Parameters
        ----------
        capture : Capture
        candidates : bool
            Find the peaks before the filters in the same run; otherwise they are found when somebody asks.

        Returns
        -------
        Detections
            What the stream yields for the same frames, all blocks and the flush together.
        """
        stream = self.open(capture, audit=candidates)
        parts = [stream.step(frames) for frames in capture.blocks(BATCH_FRAMES)]
        found = Detections.join([*parts, stream.flush()])
        if not len(found):  # an empty table has the columns that a full one would have
            found = found.with_columns(**{name: () for name in COLUMNS if name in stream.ports})
        facts: dict[str, Any] = {"chain": stream.chain, "notes": stream.notes}
        if candidates:
            return found.annotated(candidates=_candidates(found, stream.rejected), **facts)
        return found.annotated(candidates=lambda: self._audited(capture), **facts)

    def signals(self, capture: Capture) -> Iterator[Block]:
        """Blocks as the first stage that makes detections finds them: what it searches, for people to look at.

        Parameters
        ----------
        capture : Capture

        Yields
        ------
        Block
            Frames without clutter, ``first_path``, ``noise_rms`` and ``profile``, as far as the detector makes them.
        """
        opened = self.open(capture)._stages
        first = next(place for place, step in enumerate(opened) if "detections" in step.stage.produces)
        stream = Stream(opened[:first], [])
        for frames in capture.blocks(BATCH_FRAMES):
            yield stream._through(Block(_without_invalid(frames)), 0)
        yield from stream._tails()

    def _audited(self, capture: Capture) -> Detections:
        candidates = self.run(capture, candidates=True).candidates
        return Detections.empty() if candidates is None else candidates

    @property
    def identity(self) -> str:
        """SHA-256 over the resolved configuration and the sources of its stages."""
        sources = {}
        for step in self.config.steps:
            module = sys.modules[registry.load("stages", step.use).__module__]
            content = Path(module.__file__).read_bytes() if module.__file__ else b""
            sources[step.use] = hashlib.sha256(content).hexdigest()
        text = json.dumps({"detector": self.config.to_dict(), "sources": sources}, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()


def _makers_of(port: str) -> list[str]:
    """Installed stages that produce a port; those that cannot be loaded are passed over."""
    found = []
    for name in registry.entries("stages"):
        with contextlib.suppress(PluginError):
            if port in registry.load("stages", name).produces:
                found.append(name)
    return found


def _candidates(found: Detections, rejected: Detections) -> Detections:
    """Peaks before the filters, with ``retained`` 1 for those that passed them all, else ``rejected_by``."""
    kept = found.with_columns(retained=np.ones(len(found)), rejected_by=np.full(len(found), np.nan))
    dropped = rejected.with_columns(retained=np.zeros(len(rejected)))
    return Detections.join([kept, dropped])


def _without_invalid(frames: Frames) -> Frames:
    """Frames with the samples of invalid ones set to zero, so that no stage's state is poisoned by NaN."""
    if frames.valid.all():
        return frames
    parts: dict[str, Any] = {}
    for name in ("preamble", "sts1", "sts2"):
        samples = getattr(frames, name)
        if samples is not None:
            parts[name] = np.where(frames.valid[:, None], samples, 0)
    return Frames(**{**{k: v for k, v in vars(frames).items() if k != "amplitude"}, **parts})


def _without_rows_of_invalid(block: Block) -> Block:
    """Block without detections of invalid frames, whatever a stage made of their zeros."""
    frames, found = block.frames, block.detections
    if frames.valid.all() or not len(found):
        return block
    return block.replace(detections=found.take(~np.isin(found.frame, frames.index[~frames.valid])))


def _brought_along(part: Block, block: Block) -> Block:
    """Rejected detections with what a stage has just added about their frames.

    Behind a stage that holds frames back the block covers other frames; the part then keeps its own.
    """
    same = part.frames.first == block.frames.first and len(part.frames) == len(block.frames)
    return block.replace(detections=part.detections) if same else part


def load_detector(
    name: str | Path, relative_to: Path | None = None, changes: Mapping[str, Any] | None = None
) -> Pipeline:
    """Load a detector.

    Parameters
    ----------
    name : str or path
        A shipped or registered name, or a path to a detector YAML.
    relative_to : Path, optional
        Folder that a relative path starts from.
    changes : mapping, optional
        Values to change, by path, for example ``{"pipeline.filter.width.params.minimum": 2}``.

    Raises
    ------
    ConfigError, PluginError
        If the file is missing or wrong.
    """
    return Pipeline(read_detector(str(name), relative_to, changes))


def detector_from_yaml(text: str) -> Pipeline:
    """Detector from YAML text; handy in notebooks and tests."""
    return Pipeline(detector_from_text(text))
