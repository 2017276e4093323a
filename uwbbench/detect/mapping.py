"""A detector with a mapper at work on a run: a front end for each receiver, one back end for all.

Conventions
-----------
* The true pose is withheld: the frames that the front ends are given carry odometry in its place, and the mapper is
  given how odometry moved. Stages and mappers that declare that they need ``truth`` are shown it; they are references.
* A step goes to the mapper when every front end has answered for all of its frames, so that poses and map are the same
  for any cut of the frames. A front end that holds frames back delays them, and the age of the answer shows it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from uwbbench.api import registry
from uwbbench.api.arrays import IntArray
from uwbbench.api.capture import Capture
from uwbbench.api.detections import RECEIVER, Detections
from uwbbench.api.drive import Drive
from uwbbench.api.errors import CaptureError, ConfigError
from uwbbench.api.frames import BATCH_FRAMES, Frames
from uwbbench.api.mapper import Map, Mapped, Mapper, Poses, Step
from uwbbench.api.stage import Stage
from uwbbench.api.truth import Trajectory
from uwbbench.config.detector import DetectorConfig, read_detector
from uwbbench.detect.hand_out import with_hand_outs
from uwbbench.detect.pipeline import Pipeline
from uwbbench.detect.stream import Stream


def without_truth(frames: Frames) -> Frames:
    """Frames that carry odometry in place of the true pose.

    Raises
    ------
    CaptureError
        If they have no odometry.
    """
    position_m, yaw_rad = frames.odometry_position_m, frames.odometry_yaw_rad
    if position_m is None or yaw_rad is None:
        raise CaptureError("frames of a run have no odometry, which a mapper needs")
    return dataclasses.replace(frames, position_m=position_m, yaw_rad=yaw_rad)


def _with_hidden_background(capture: Capture) -> Capture:
    """Capture whose background has no true poses; the robot is at the origin there."""
    background = capture.background
    if background is None:
        return capture
    frames = len(background)
    nowhere = Trajectory(background.trajectory.timestamp_s, np.zeros((frames, 3)), np.zeros(frames))
    return dataclasses.replace(capture, background=dataclasses.replace(background, trajectory=nowhere))


class _Receiver:
    """One receiver of a run: its front end, and the rows that wait for the other receivers."""

    def __init__(self, name: str, pipeline: Pipeline, capture: Capture, steps: IntArray, *, keep: bool) -> None:
        self.name, self.steps, self.anchors = name, steps, capture.anchors
        self.pipeline, self.capture, self._keeps = pipeline, capture, keep
        # Stages that need the truth are shown it, with the true poses; all others have the frames alone.
        self.stream: Stream = pipeline.open(_with_hidden_background(capture))
        self.given = -1
        self._waiting = Detections.empty()
        self._answers: list[Detections] = []

    def detect(self, frames: Frames) -> None:
        """Let the front end answer."""
        self.given = int(self.steps[frames.first + len(frames) - 1])
        self._keep(self.stream.step(without_truth(frames)))

    def flush(self) -> None:
        """Let the front end answer for what it holds back."""
        self._keep(self.stream.flush())

    @property
    def answers(self) -> Detections:
        """Frames of the rows, and those answered for, so far, where they are kept."""
        return Detections.join(self._answers)

    def _keep(self, found: Detections) -> None:
        if self._keeps:
            self._answers.append(Detections(found.frame, processed=found.processed))
        self._waiting = Detections.join([self._waiting, found]) if len(self._waiting) else found

    @property
    def unanswered(self) -> int:
        """First step that the front end has not answered for yet; beyond all where it has answered for all."""
        frame = self.stream.answered
        return int(self.steps[frame]) if frame < len(self.steps) else np.iinfo(np.int64).max

    def take(self, stop: int) -> Detections:
        """Rows of the steps before ``stop``, with the step as their frame; they are gone then."""
        step = self.steps[self._waiting.frame]
        ready = step < stop
        rows = self._waiting.take(ready)
        self._waiting = self._waiting.take(~ready)
        columns: dict[str, Any] = {name: values for name, values in rows.columns.items() if name != "frame"}
        return Detections(step[ready], **columns)

    def frame_of(self, step: int) -> int | None:
        """Frame of a step; None where the receiver has none. Looked up in a time that hardly grows with the run."""
        frame = int(np.searchsorted(self.steps, step))
        return frame if frame < len(self.steps) and self.steps[frame] == step else None


class MapperLoop:
    """A detector with a mapper at work on one run.

    Made by :meth:`MappingPipeline.open`; not shared between threads.

    Parameters
    ----------
    receivers : list
        Front ends at work.
    mapper : Mapper
        Opened.
    drive : Drive
    keep : bool
        Keep the rows of the front ends for :attr:`rows`; a long stream goes without.

    Attributes
    ----------
    mapper : Mapper
    """

    def __init__(self, receivers: list[_Receiver], mapper: Mapper[Any], drive: Drive, *, keep: bool) -> None:
        self._receivers, self.mapper, self._drive, self._keep = receivers, mapper, drive, keep
        self._next = 0
        self._rows: list[Detections] = []

    @property
    def needs(self) -> frozenset[str]:
        """What front ends and mapper need of the run."""
        own = [self.mapper.needs, *(receiver.stream.needs for receiver in self._receivers)]
        return frozenset().union(*own)

    @property
    def stages(self) -> tuple[Stage[Any], ...]:
        """Stages at work in all front ends."""
        return tuple(stage for receiver in self._receivers for stage in receiver.stream.stages)

    def step(self, frames: Mapping[str, Frames]) -> Poses:
        """Poses that are known after these frames.

        Parameters
        ----------
        frames : mapping of str to Frames
            The next consecutive frames of each receiver, as :meth:`~uwbbench.api.drive.Drive.frames` gives them.
        """
        for receiver in self._receivers:
            if receiver.name in frames:
                receiver.detect(frames[receiver.name])
        return self._advance()

    def flush(self) -> Poses:
        """Poses of the steps that were still waiting for a front end; after this nothing can be added."""
        for receiver in self._receivers:
            receiver.flush()
        return self._advance()

    def finish(self) -> tuple[Poses | None, Map]:
        """Smoothed trajectory, if the mapper looks back, and the map; after the flush."""
        return self.mapper.finish()

    @property
    def rows(self) -> Detections:
        """Rows of all front ends so far, where they are kept: by step, with the place of their receiver."""
        return Detections.join(self._rows) if self._rows else Detections.empty()

    def ready(self) -> IntArray:
        """Step (steps,) after which all front ends have answered for each; the number of steps for only at the end.

        For a whole run whose rows are kept: each front end goes through its capture once more, in smaller parts.
        """
        steps = len(self._drive)
        ready = np.arange(steps)
        for receiver in self._receivers:
            found = with_hand_outs(receiver.pipeline, receiver.capture, receiver.answers)
            if found.answered is None:
                continue
            after = np.append(receiver.steps, steps)[found.answered]
            own = np.zeros(steps, np.int64)
            own[receiver.steps[found.processed]] = after
            ready = np.maximum(ready, np.maximum.accumulate(own))
        return ready

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader of the results must know, so far."""
        several = len(self._receivers) > 1
        notes = [
            f"{receiver.name}: {note}" if several else note
            for receiver in self._receivers
            for note in receiver.stream.notes
        ]
        return tuple(dict.fromkeys([*notes, *self.mapper.notes]))

    def _advance(self) -> Poses:
        """Poses of the steps that all front ends have answered for."""
        read = max(receiver.given for receiver in self._receivers) + 1
        stop = min([read, *(receiver.unanswered for receiver in self._receivers)])
        if stop <= self._next:
            return Poses.none()
        first, self._next = self._next, stop
        steps = np.arange(first, stop)
        found = {receiver.name: receiver.take(stop) for receiver in self._receivers}
        edges = {name: np.searchsorted(rows.frame, np.append(steps, stop)) for name, rows in found.items()}
        poses = []
        for at, index in enumerate(steps.tolist()):
            rows, messages = {}, {}
            for receiver in self._receivers:
                name = receiver.name
                frame = receiver.frame_of(index)
                if frame is None:
                    continue
                rows[name] = found[name].take(np.arange(edges[name][at], edges[name][at + 1]))
                if receiver.anchors is not None and len(heard := receiver.anchors.heard_in(frame)):
                    messages[name] = heard
            time_s, moved = float(self._drive.time_s[index]), self._drive.moved[index]
            poses.append(self.mapper.step(Step(index, time_s, moved, rows, messages)))
        if not self._keep:
            return Poses.join(poses)
        places = enumerate(found.values())
        every = Detections.join(
            [rows.with_columns(**{RECEIVER: np.full(len(rows), float(place))}) for place, rows in places]
        )
        order = np.argsort(every.frame, kind="stable")
        self._rows.append(every.take(order))
        return Poses.join(poses)


class MappingPipeline:
    """A detector with a mapper: front ends with checked ports, and a back end.

    Parameters
    ----------
    config : DetectorConfig
        Validated detector file with a mapper.

    Raises
    ------
    ConfigError
        If it has none, or a front end does not make what the mapper consumes.
    """

    def __init__(self, config: DetectorConfig) -> None:
        if config.mapper is None:
            raise ConfigError(f"detector '{config.name}' has no mapper: it finds obstacles in single captures")
        self.config = config
        self._use = config.mapper
        self._mapper: type[Mapper[Any]] = registry.load_plugin("mappers", config.mapper.use)
        for receiver in ("", *config.fronts):
            self._check_ports(receiver)

    @property
    def name(self) -> str:
        """Name in tables and reports."""
        return self.config.name

    @property
    def identity(self) -> str:
        """SHA-256 over the resolved configuration and the sources of stages and mapper."""
        return Pipeline(self.config).identity

    def __repr__(self) -> str:
        steps = " -> ".join(step.label for step in self.config.steps)
        return f"MappingPipeline({self.name}: {steps} => {self._use.use})"

    def _check_ports(self, receiver: str) -> None:
        made: set[str] = {"frames"}
        for step in Pipeline(self.config.front(receiver)).config.steps:
            stage = registry.load_plugin("stages", step.use)
            made = (made - stage.removes) | stage.produces
        missing = sorted(self._mapper.consumes - made)
        if missing:
            where = f" of receiver '{receiver}'" if receiver else ""
            raise ConfigError(
                f"detector '{self.name}': mapper '{self._use.use}' needs '{missing[0]}', "
                f"which no step of the front end{where} makes"
            )

    def open(self, drive: Drive, *, keep: bool = False) -> MapperLoop:
        """Start on a run.

        Parameters
        ----------
        drive : Drive
        keep : bool
            Keep the rows of the front ends for :attr:`MapperLoop.rows`.

        Raises
        ------
        ConfigError
            If the run lacks what the mapper or a front end needs.
        CaptureError
            If a capture has no odometry.
        """
        needs, use = self._mapper.needs, self._use.use
        if len(drive.captures) < self._mapper.receivers:
            raise ConfigError(
                f"detector '{self.name}': mapper '{use}' needs {self._mapper.receivers} receivers; "
                f"run '{drive.name}' has {len(drive.captures)}"
            )
        if "anchors" in needs and all(capture.anchors is None for capture in drive.captures):
            raise ConfigError(f"detector '{self.name}': mapper '{use}' needs anchors; run '{drive.name}' has none")
        if "truth" in needs and drive.header.truth is None:
            raise ConfigError(f"detector '{self.name}': mapper '{use}' needs truth; run '{drive.name}' has none")
        unknown = sorted(set(self.config.fronts) - set(drive.radars))
        receivers = [
            _Receiver(name, Pipeline(self.config.front(name)), capture, drive.steps[name], keep=keep)
            for name, capture in zip(drive.radars, drive.captures, strict=True)
        ]
        mapper = self._mapper(self._mapper.params_type().model_validate(self._use.params))
        mapper.open(drive.radars, Poses.of_one(0, drive.odometry[0], np.zeros((3, 3))))
        if "truth" in needs and drive.header.truth is not None:
            mapper.show_truth(drive.header.truth, drive.header.trajectory)
        if unknown:
            mapper.note(f"front end of '{unknown[0]}' not used: the run has no such receiver")
        return MapperLoop(receivers, mapper, drive, keep=keep)

    def run(self, drive: Drive, *, handed_out: bool = False, block: int = BATCH_FRAMES) -> Detections:
        """Poses and map of a whole run.

        Parameters
        ----------
        drive : Drive
        handed_out : bool
            Find out after which step each pose is handed out, which the age of the answer asks for.
        block : int
            Steps that are read at once; poses and map are the same for any.

        Returns
        -------
        Detections
            Rows of all front ends, with the step as their ``frame`` and the column ``receiver``; ``processed`` are the
            steps that have a pose; ``mapped`` holds poses and map.
        """
        loop = self.open(drive, keep=True)
        sts = "sts" in loop.needs
        poses = Poses.join([*(loop.step(frames) for frames in drive.blocks(block, sts=sts)), loop.flush()])
        smoothed, learnt = loop.finish()
        found = loop.rows.annotated(
            processed=poses.index, notes=loop.notes, mapped=Mapped(poses, learnt, smoothed), chain={}
        )
        if not handed_out:
            return found
        ready = loop.ready()
        return found.with_hand_outs(ready[found.frame], ready[poses.index])

    def answers(self, drive: Drive, steps: int) -> Detections:
        """When the poses of the first steps were handed out: a row a pose, with hand-outs.

        Parameters
        ----------
        drive : Drive
        steps : int
            So many.
        """
        found = self.run(drive, handed_out=True)
        assert found.answered is not None  # noqa: S101 - asked for
        early = found.processed < steps
        index, answered = found.processed[early], found.answered[early]
        return Detections(index, processed=index).with_hand_outs(answered, answered)


def load_mapper(
    name: str | Path, relative_to: Path | None = None, changes: Mapping[str, Any] | None = None
) -> MappingPipeline:
    """Load a detector that has a mapper.

    Parameters
    ----------
    name : str or Path
        A shipped or registered name, or a path to a detector YAML.
    relative_to : Path, optional
        Folder that a relative path starts from.
    changes : mapping, optional
        Values to change, by path, for example ``{"mapper.params.gate": 9.21}``.

    Raises
    ------
    ConfigError, PluginError
        If the file is missing or wrong, or has no mapper.
    """
    return MappingPipeline(read_detector(str(name), relative_to, changes))
