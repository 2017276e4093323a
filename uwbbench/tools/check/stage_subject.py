"""A stage under examination, behind a chain that makes all that it consumes."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from uwbbench.api import registry
from uwbbench.api.block import Block
from uwbbench.api.capture import Capture
from uwbbench.api.case import NotApplicable
from uwbbench.api.detections import Detections
from uwbbench.api.errors import UwbbenchError
from uwbbench.api.registry import AuthoredKind
from uwbbench.api.stage import Stage
from uwbbench.api.weights import load_weights
from uwbbench.tools.check.check import Nonconformity
from uwbbench.tools.check.inputs import frames_of, pieces, usual_capture
from uwbbench.tools.check.params import working_params
from uwbbench.tools.check.subject import ClassSubject
from uwbbench.tools.check.values import Values, of_blocks

PARTS = {
    "first_path": "first_path",
    "noise": "noise_rms",
    "profile": "profile",
    "aligned": "aligned",
    "window_mean": "window_mean",
    "window_sd": "window_sd",
    "features": "features",
}
"""Attribute of a block behind each port that is one."""


class StageSubject(ClassSubject):
    """One stage, and the usual block that it is given."""

    kind: ClassVar[AuthoredKind] = "stage"
    base: ClassVar[type] = Stage

    @cached_property
    def params(self) -> Any:
        """Parameters that it is examined with."""
        return working_params(self.cls.params_type(), self.given, f"stage '{self.name}'", self.name)

    @property
    def needs(self) -> frozenset[str]:
        """What it needs of a capture with these parameters."""
        return frozenset(self.cls.needs_with(self.params))

    @property
    def capture(self) -> Capture:
        """The usual capture."""
        return usual_capture()

    def opened(self, capture: Capture | None = None) -> Stage[Any]:
        """A fresh instance at the start of a stream."""
        capture = capture or self.capture
        stage: Stage[Any] = self.cls(self.params)
        self.reopen(stage, capture)
        return stage

    def reopen(self, stage: Stage[Any], capture: Capture | None = None, cuts: Sequence[int] = ()) -> None:
        """Start a stream as a pipeline does.

        Parameters
        ----------
        stage : Stage
        capture : Capture, optional
            The usual one if left out.
        cuts : sequence of int
            Frames, ascending, before which its background is cut.
        """
        capture = capture or self.capture
        load_weights(stage, capture.radar)
        stage.open(capture.radar)
        if "truth" in self.cls.needs and capture.truth is not None:
            stage.show_truth(capture.truth, capture.trajectory)
        if "background" in self.needs and capture.background is not None:
            background = self.declared(behind_all(capture.background, self.cls.consumes))
            stage.show_background(iter(pieces(background, cuts)))

    @cached_property
    def full_block(self) -> Block:
        """The usual capture behind all usual stages, and those that make what this one consumes besides."""
        return behind_all(self.capture, self.cls.consumes)

    @cached_property
    def block(self) -> Block:
        """The full block with nothing but what this stage declares that it consumes."""
        return self.declared(self.full_block)

    def declared(self, block: Block) -> Block:
        """Block with nothing but what this stage declares that it consumes and needs."""
        return declared_parts(block, self.cls.consumes, self.needs)

    def run(self, block: Block, cuts: Sequence[int] = (), stage: Stage[Any] | None = None) -> Values:
        """What the stage yields for a block handed over in pieces, the flush included.

        Parameters
        ----------
        block : Block
        cuts : sequence of int
            Frames of the block, ascending, before which it is cut.
        stage : Stage, optional
            Opened instance; a fresh one where there is none.
        """
        stage = stage or self.opened()
        yielded = [stage.step(piece) for piece in pieces(block, cuts)]
        tail = stage.flush()
        return of_blocks([*yielded, *([] if tail is None else [tail])])

    def result(self) -> Values:
        """What a fresh instance makes of the usual block."""
        return self.run(self.block)

    def input_arrays(self) -> Mapping[str, NDArray[Any]]:
        """Arrays of the usual block."""
        block = self.block
        arrays = {f"frames.{name}": value for name, value in vars(block.frames).items()}
        for name in PARTS.values():
            part = getattr(block, name)
            plain = part is None or isinstance(part, np.ndarray)
            arrays |= {name: part} if plain else {f"{name}.{key}": value for key, value in vars(part).items()}
        arrays |= {f"detections.{name}": column for name, column in block.detections.columns.items()}
        return {name: value for name, value in arrays.items() if isinstance(value, np.ndarray)}

    @property
    def adds(self) -> frozenset[str]:
        """Names, as :func:`uwbbench.tools.check.values.of_blocks` gives them, of what this stage answers for."""
        kept: frozenset[str] = self.cls.consumes & {"detections"}
        produced: frozenset[str] = self.cls.produces
        return produced | kept


def declared_parts(block: Block, consumes: frozenset[str], needs: frozenset[str]) -> Block:
    """Block without the parts, columns and reported values that are not among these.

    Parameters
    ----------
    block : Block
    consumes : frozenset of str
        Ports to keep. Without ``detections`` among them, no detection is left.
    needs : frozenset of str
        What else of the capture to keep: ``sts`` responses, the reported ``first_path``.
    """
    columns: dict[str, Any] = {n: v for n, v in block.detections.columns.items() if n == "frame" or n in consumes}
    frame = columns.pop("frame")
    kept = Detections.empty(block.frames.index)
    if "detections" in consumes:
        kept = Detections(frame, processed=block.frames.index, **columns)
    parts: dict[str, Any] = {PARTS[port]: None for port in PARTS.keys() - consumes}
    absent = [name for name in ("sts1", "sts2") if "sts" not in needs]
    absent += [name for name in vars(block.frames) if name.startswith("first_path") and "first_path" not in needs]
    frames = _without(block, absent).frames
    return block.replace(frames=frames, detections=kept, **parts)


def lacking(block: Block, port: str) -> Block:
    """Block in which one port is gone; samples, which are always there, are replaced by others."""
    if port == "frames":
        frames = block.frames.with_preamble(np.ascontiguousarray(block.frames.preamble[:, ::-1]))
        return block.replace(frames=frames)
    if port in PARTS:
        return block.replace(**{PARTS[port]: None})
    if port == "detections":
        return block.replace(detections=Detections.empty(block.frames.index))
    if port == "STS responses":
        return _without(block, ["sts1", "sts2"])
    if port == "reported first path":
        return _without(block, [name for name in vars(block.frames) if name.startswith("first_path")])
    columns: dict[str, Any] = {name: values for name, values in block.detections.columns.items() if name != port}
    return block.replace(detections=Detections(**columns, processed=block.detections.processed))


def _without(block: Block, names: Sequence[str]) -> Block:
    absent: dict[str, Any] = dict.fromkeys(names)
    return block.replace(frames=dataclasses.replace(block.frames, **absent))


def behind_all(capture: Capture, consumes: frozenset[str]) -> Block:
    """All frames of a capture behind the usual stages, and behind those that make other ports that are consumed.

    Raises
    ------
    Nonconformity
        If no installed stage makes one of them.
    """
    block = Block(frames_of(capture))
    ports = frozenset({"frames"})
    for name in _makers():
        with contextlib.suppress(UwbbenchError):  # one that refuses this radar is missed where its port is consumed
            block, ports = _through(name, block, ports, capture)
    for port in sorted(consumes - ports):
        block, ports = _with_port(port, block, ports, capture)
    return block


def _makers() -> list[str]:
    """Default makers of ports: at each place the first, by the name of its port, for which all that it takes is there.

    A range is thus taken behind the azimuth that it looks at where there is one. Those that take ports away, as
    trackers do, are left to whoever consumes what they make.
    """
    every = {name: registry.load_plugin("stages", name) for name in registry.makers().values()}
    waiting = {name: cls for name, cls in every.items() if not cls.removes}
    chain: list[str] = []
    ports = frozenset({"frames"})
    while ready := next((name for name, cls in waiting.items() if cls.consumes <= ports), None):
        ports |= waiting.pop(ready).produces
        chain.append(ready)
    return chain


def _with_port(
    port: str, block: Block, made: frozenset[str], capture: Capture, waiting: frozenset[str] = frozenset()
) -> tuple[Block, frozenset[str]]:
    """Block behind the first stage that makes a port, and behind those that make what that one takes.

    Parameters
    ----------
    port : str
    block : Block
    made : frozenset of str
        Ports that are there already.
    capture : Capture
    waiting : frozenset of str
        Ports that are being made with the help of this one, and cannot help to make it.

    Raises
    ------
    UwbbenchError
        If the only stages that make it refuse the capture.
    Nonconformity
        If no installed stage makes it.
    """
    refused: list[UwbbenchError] = []
    waiting |= {port}
    for name in registry.entries("stages"):
        try:
            cls = registry.load_plugin("stages", name)
            if port not in cls.produces or cls.consumes & waiting:
                continue
            behind, known = block, made
            for other in sorted(cls.consumes - made):
                behind, known = _with_port(other, behind, known, capture, waiting)
            behind, known = _through(name, behind, known, capture)
        except UwbbenchError as error:  # another stage may make it
            refused.append(error)
        except (NotApplicable, Nonconformity):
            continue
        else:
            if port in known:
                return behind, known
    if refused:
        raise refused[0]
    raise Nonconformity("ports that an installed stage makes", f"none that makes '{port}' from the usual ports")


def _through(name: str, block: Block, made: frozenset[str], capture: Capture) -> tuple[Block, frozenset[str]]:
    """Block behind one stage, where the capture and the block have all that it takes; else as before."""
    cls = registry.load_plugin("stages", name)
    lacks_sts = "sts" in cls.needs and not capture.radar.has_sts
    if lacks_sts or cls.needs & {"truth", "background"} or cls.consumes - made:
        return block, made
    stage: Stage[Any] = cls(working_params(cls.params_type(), {}, f"stage '{name}'", name))
    load_weights(stage, capture.radar)
    stage.open(capture.radar)
    parts = [stage.step(block)]
    tail = stage.flush()
    return Block.join([*parts, *([] if tail is None else [tail])]), made | cls.produces
