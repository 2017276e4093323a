"""Checks of a dataset adapter: its card, its names, and the captures it opens."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path, PurePosixPath
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from uwbbench.api import registry
from uwbbench.api.capture import Capture
from uwbbench.api.capture_file import open_capture
from uwbbench.api.capture_writing import write_capture
from uwbbench.api.case import NotApplicable, last_line
from uwbbench.api.dataset import Card, Dataset
from uwbbench.api.errors import CaptureError
from uwbbench.api.frames import Frames
from uwbbench.api.registry import AuthoredKind
from uwbbench.detect.pipeline import detector_from_yaml
from uwbbench.tools.check.check import Nonconformity, check
from uwbbench.tools.check.params import working_params
from uwbbench.tools.check.subject import ClassSubject
from uwbbench.tools.check.values import Values, same

_CARD, _DATASET, _CAPTURE = "uwbbench.api.dataset.Card", "uwbbench.api.dataset.Dataset", "uwbbench.api.capture.Capture"
_ONE_A_FRAME = "schema: 1\nname: constant\npipeline:\n  - {{use: {}}}\n"


class DatasetSubject(ClassSubject):
    """One dataset adapter, and the first of its captures."""

    kind: ClassVar[AuthoredKind] = "dataset"
    base: ClassVar[type] = Dataset

    @cached_property
    def params(self) -> Any:
        """Parameters that it is examined with."""
        return working_params(self.cls.params_type(), self.given, f"dataset '{self.name}'")

    def adapter(self, roots: tuple[Path, ...] | None = None) -> Dataset[Any]:
        """A fresh adapter."""
        adapter: Dataset[Any] = self.cls(self.params, self.roots if roots is None else roots)
        return adapter

    @cached_property
    def names(self) -> list[str]:
        """Names of its captures.

        Raises
        ------
        NotApplicable
            If the files that its card lists are not on this machine.
        """
        adapter = self.adapter()
        for file in adapter.card.files:
            try:
                adapter.file(file.path)
            except CaptureError as error:
                raise NotApplicable(f"its files are not here: {error}") from error
        return adapter.names()

    def opened(self) -> Capture:
        """Its first capture, by a fresh adapter."""
        if not self.names:
            raise NotApplicable("it has no captures")
        return self.adapter().open(self.names[0])

    @cached_property
    def capture(self) -> Capture:
        """Its first capture, once."""
        return self.opened()

    def result(self) -> Values:
        """All that the first capture holds, as arrays."""
        return values_of(self.opened().frames())

    def input_arrays(self) -> Mapping[str, NDArray[Any]]:
        """Nothing: an adapter is given no arrays."""
        return {}


def values_of(frames: Frames) -> Values:
    """Arrays of frames."""
    return {name: value for name, value in vars(frames).items() if isinstance(value, np.ndarray)}


@check(_CARD)
def card_is_complete(subject: DatasetSubject) -> str:
    """The card has a title, a licence, a citation, a source and an origin: results print them."""
    card = getattr(subject.cls, "card", None)
    if not isinstance(card, Card):
        raise Nonconformity("card: ClassVar[Card] = Card(...)", repr(card))
    missing = [name for name in ("title", "license", "citation", "source") if not getattr(card, name).strip()]
    if missing:
        raise Nonconformity("a complete card", f"no {', '.join(missing)}")
    if card.origin not in ("measured", "simulated"):
        raise Nonconformity("origin 'measured' or 'simulated'", repr(card.origin))
    return f"{card.title} ({card.license}, {card.origin})"


@check("uwbbench.api.dataset.DatasetFile")
def files_are_pinned(subject: DatasetSubject) -> str:
    """Each file has a path below the folder, a SHA-256, and an HTTPS address or none: downloads are checked."""
    files = subject.cls.card.files
    if not files:
        raise NotApplicable("the card lists no files")
    for file in files:
        path = PurePosixPath(file.path)
        if path.is_absolute() or ".." in path.parts:
            raise Nonconformity("paths below the dataset's folder", file.path)
        if not re.fullmatch(r"[0-9a-f]{64}", file.sha256):
            raise Nonconformity(f"64 hexadecimal digits as SHA-256 of {file.path}", repr(file.sha256))
        if file.url and not file.url.startswith("https://"):
            raise Nonconformity(f"an https address of {file.path}, or none where users bring it", repr(file.url))
    return f"{len(files)} files"


@check(_DATASET)
def names_are_unique_and_stable(subject: DatasetSubject) -> str:
    """Names are different texts, in one order every time: results are kept by them, and seeds may follow the order."""
    names = subject.names
    if not names or not all(isinstance(name, str) and name for name in names):
        raise Nonconformity("a list of names", repr(names)[:80])
    double = sorted({name for name in names if names.count(name) > 1})
    if double:
        raise Nonconformity("names that differ", f"{double[0]!r} twice")
    if subject.adapter().names() != names:
        raise Nonconformity("the same names in the same order again", "others")
    return f"{len(names)} captures"


@check("uwbbench.api.dataset.Dataset.names")
def names_open_nothing(subject: DatasetSubject) -> None:
    """Names are found without opening a capture: a list of a thousand recordings must be instant."""
    subject.names  # noqa: B018 - does not apply where the files are missing
    adapter = subject.adapter()
    opened: list[str] = []

    def watched(name: str) -> Capture:
        opened.append(name)
        return type(adapter).open(adapter, name)

    adapter.open = watched  # type: ignore[method-assign]
    adapter.names()
    if opened:
        raise Nonconformity("names without opening", f"{len(opened)} captures opened")


@check("uwbbench.api.errors.nearest")
def unknown_names_are_refused(subject: DatasetSubject) -> str:
    """A name that is not there is a CaptureError in one line, which names the nearest or all that are known."""
    wanted = f"{subject.names[0]}x"
    try:
        subject.adapter().open(wanted)
    except CaptureError as error:
        if "\n" in str(error) or wanted not in str(error):
            raise Nonconformity(f"one line that names '{wanted}'", repr(str(error))) from error
        return str(error)
    except Exception as error:
        raise Nonconformity("a CaptureError", last_line(error)) from error
    raise Nonconformity("a CaptureError", f"a capture by the name '{wanted}'")


@check("uwbbench.api.dataset.Dataset.file")
def missing_files_are_told(subject: DatasetSubject) -> str:
    """Where the files are missing, one CaptureError in one line says what and where: no traceback, no empty capture."""
    with tempfile.TemporaryDirectory() as folder:
        adapter = subject.adapter((Path(folder),))
        try:
            names = adapter.names()
            if names:
                adapter.open(names[0]).frames()
        except CaptureError as error:
            if "\n" in str(error):
                raise Nonconformity("one line", f"{str(error).count(chr(10)) + 1} lines") from error
            return str(error)
        except Exception as error:
            raise Nonconformity("a CaptureError that names the file", last_line(error)) from error
    if subject.cls.card.files:
        raise Nonconformity("a CaptureError that names the file", f"{len(names)} captures")
    raise NotApplicable("it needs no files")


@check(_CAPTURE)
def capture_says_what_it_is(subject: DatasetSubject) -> str:
    """A capture bears its name, the card's origin and a licence: simulated results are labelled so everywhere."""
    capture, card = subject.capture, subject.cls.card
    if not isinstance(capture, Capture):
        raise Nonconformity("a Capture", type(capture).__name__)
    if not capture.license or capture.license == "unknown":
        raise Nonconformity("a licence, for example self.card.license", repr(capture.license))
    own_files = not card.files and card.origin == "measured"  # files of users may hold either
    if capture.source != card.origin and not own_files:
        raise Nonconformity(f"source '{card.origin}', as the card says", f"'{capture.source}'")
    if capture.name != subject.names[0] and not own_files:
        raise Nonconformity(f"name '{subject.names[0]}'", f"'{capture.name}'")
    return f"{capture.name}: {len(capture)} frames of {capture.radar.taps} taps"


@check(_CAPTURE)
def capture_is_sound(subject: DatasetSubject) -> str:
    """There are frames, at least half of them finite, at times that agree with the frame rate, and poses are finite."""
    capture = subject.capture
    if not len(capture):
        raise Nonconformity("frames", "none")
    frames = capture.frames()
    valid = float(frames.valid.mean())
    if valid < 0.5:
        raise Nonconformity("finite samples in most frames", f"in {valid:.0%}")
    if not np.iscomplexobj(frames.preamble):
        raise Nonconformity("complex samples, or Radar(samples='rf')", str(frames.preamble.dtype))
    if not np.isfinite(frames.position_m).all() or not np.isfinite(frames.yaw_rad).all():
        raise Nonconformity("finite poses", "some that are not")
    if len(capture) > 2:
        rate_hz = 1 / max(float(np.median(np.diff(frames.timestamp_s))), 1e-9)
        if not 0.5 < rate_hz / capture.radar.frame_rate_hz < 2:
            raise Nonconformity(f"times of {capture.radar.frame_rate_hz:g} frames a second", f"{rate_hz:.3g} a second")
    return f"{valid:.0%} of {len(capture)} frames valid"


@check("uwbbench.api.truth.Truth")
def truth_is_in_sight(subject: DatasetSubject) -> str:
    """Labelled objects have a range in some frame, and the nearest comes within the radar's window: mind the units."""
    capture = subject.capture
    if capture.truth is None:
        raise NotApplicable("the capture has no ground truth")
    if not capture.truth.objects:
        return "nothing to find"
    range_m = capture.truth.seen_from(capture.radar, capture.trajectory).range_m
    known = range_m[np.isfinite(range_m)]
    if not known.size:
        raise Nonconformity("a range in some frame", "NaN in all frames")
    if known.min() > capture.radar.window_m:
        raise Nonconformity(f"an object within the {capture.radar.window_m:.2f} m of the taps", f"{known.min():.2f} m")
    return f"{known.min():.2f} to {known.max():.2f} m"


@check("uwbbench.api.capture.Capture.blocks")
def blocks_equal_the_whole(subject: DatasetSubject) -> None:
    """Frames that are read block by block are those that are read at once."""
    capture = subject.capture
    joined = Frames.join(list(capture.blocks(max(1, len(capture) // 3))))
    same(values_of(capture.frames()), values_of(joined), "the same frames in blocks")


@check("uwbbench.api.capture.Capture.sha256")
def hash_is_stable(subject: DatasetSubject) -> str:
    """Opening twice gives one SHA-256: a manifest proves by it what was measured."""
    one, other = subject.opened().sha256, subject.opened().sha256
    if one != other:
        raise Nonconformity(f"SHA-256 {one[:12]} again", other[:12])
    return one[:12]


@check("uwbbench.api.capture_writing.write_capture")
def capture_can_be_kept(subject: DatasetSubject) -> None:
    """The capture can be written to a file and read again, in the precision that files have."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "kept.h5"
        write_capture(file, subject.capture)
        again = open_capture(file).frames()
    usual = subject.capture.frames()
    if not np.allclose(again.preamble, usual.preamble, rtol=1e-5, atol=0, equal_nan=True):
        raise Nonconformity("the same samples from the file", "others")


@check("uwbbench.detect.pipeline.Pipeline.run")
def detectors_take_it(subject: DatasetSubject) -> str:
    """A detector that answers in every frame without looking does so on the first capture."""
    capture = subject.capture
    detections = detector_from_yaml(_ONE_A_FRAME.format(registry.default("stage.constant"))).run(capture)
    expected = int(capture.frames().valid.sum())
    if len(detections) != expected:
        raise Nonconformity(f"{expected} detections, one for each valid frame", str(len(detections)))
    return f"{len(detections)} detections"


CHECKS = (
    card_is_complete,
    files_are_pinned,
    names_are_unique_and_stable,
    names_open_nothing,
    unknown_names_are_refused,
    missing_files_are_told,
    capture_says_what_it_is,
    capture_is_sound,
    truth_is_in_sight,
    blocks_equal_the_whole,
    hash_is_stable,
    capture_can_be_kept,
    detectors_take_it,
)
