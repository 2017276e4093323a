"""A capture: one run of one receiver, opened lazily."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from functools import cached_property, lru_cache
from typing import Any, Literal, Protocol, runtime_checkable

import numpy as np

from uwbbench.api.anchors import Anchors
from uwbbench.api.arrays import BoolArray, ComplexArray, FloatArray, lock_fields, locked
from uwbbench.api.bounds import check_places, check_shape, check_truth
from uwbbench.api.errors import CaptureError
from uwbbench.api.frames import Frames
from uwbbench.api.radar import Radar
from uwbbench.api.truth import Trajectory, Truth


@runtime_checkable
class Samples(Protocol):
    """Anything sliced like a (frames, taps) array: an array, a mapped file or an HDF5 dataset."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Frames and taps."""

    def __getitem__(self, key: Any, /) -> Any:
        """Rows as an array."""


def analytic(real: FloatArray) -> ComplexArray:
    """Analytic signal of real samples (frames, taps) along the taps.

    Negative frequencies are set to zero and positive ones doubled, so that the magnitude is the envelope
    (Marple, IEEE Trans. Signal Processing 47(9), 1999).
    """
    spectrum = np.fft.fft(real.astype(np.float64), axis=-1)
    return np.asarray(np.fft.ifft(spectrum * _analytic_gain(real.shape[-1]), axis=-1))


@lru_cache(maxsize=8)
def _analytic_gain(taps: int) -> FloatArray:
    """Gain (taps,) of each frequency; kept, as a stream asks for it in every frame."""
    gain = np.zeros(taps)
    gain[0] = 1.0
    gain[1 : (taps + 1) // 2] = 2.0
    if taps % 2 == 0:
        gain[taps // 2] = 1.0
    return gain


def _finite_frames(samples: Any) -> BoolArray:
    """Mask (frames,) of the rows without NaN and infinity.

    Nearly always all of them are, which their sum of squares shows, the cheapest to ask of a single frame; where it is
    not finite, be it by overflow, each row is checked.
    """
    real = samples.view(samples.real.dtype)
    if math.isfinite(np.vdot(real, real)):
        return np.ones(len(samples), dtype=np.bool_)
    return np.asarray(np.isfinite(real).all(axis=1))


@dataclass(frozen=True, kw_only=True)
class CaptureHeader:
    """All of a capture but its samples: enough to score detections.

    Attributes
    ----------
    name : str
    radar : Radar
    trajectory : Trajectory
    truth : Truth or None
        None where there is no ground truth: the capture can be detected on, timed and plotted, not scored.
    source : {"measured", "simulated"}
    license, citation, description : str
    recording : str
        What the capture is of, the same for all receivers of a run: captures of one recording leak into each other
        (:mod:`uwbbench.api.recording`). The name without its receiver if left out.
    robot : str
        Identity of the robot, whose ringing is in every frame; empty where it is not known.
    radars : tuple of Radar
        Of a run: those of all its receivers. Empty: the radar alone.
    """

    name: str
    radar: Radar
    trajectory: Trajectory
    truth: Truth | None = None
    source: Literal["measured", "simulated"] = "measured"
    license: str = "unknown"
    citation: str = ""
    description: str = ""
    recording: str = ""
    robot: str = ""
    radars: tuple[Radar, ...] = ()

    def __post_init__(self) -> None:
        if not self.recording:
            named = self.name.removesuffix(f"/{self.radar.receiver}")
            object.__setattr__(self, "recording", named)

    def __len__(self) -> int:
        return len(self.trajectory)

    def __repr__(self) -> str:
        size = f"{len(self)} frames of {self.radar.taps} taps, {self.duration_s:.2f} s"
        return f"{type(self).__name__}({self.name!r}, {self.source}: {size})"

    def _repr_html_(self) -> str:
        from uwbbench.show.notebook.capture import capture

        return capture(self)

    @property
    def duration_s(self) -> float:
        """Time from the first to the end of the last frame."""
        times = self.trajectory.timestamp_s
        return float(times[-1] - times[0] + 1 / self.radar.frame_rate_hz) if len(times) else 0.0


PER_FRAME = (
    "first_path_index",
    "first_path_index_sts1",
    "first_path_index_sts2",
    "odometry_position_m",
    "odometry_yaw_rad",
)
"""Arrays of a capture that have a value for each frame and need not be there."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Capture(CaptureHeader):
    """One run of one receiver.

    Its arrays, and those of the frames that it hands out, cannot be written to: detectors share them.

    Attributes
    ----------
    preamble : (frames, taps) samples
        Complex, or real where the radar stores RF; read where they lie.
    sts1, sts2 : (frames, taps) complex samples or None
        The responses of the two antennas; both or neither.
    first_path_index, first_path_index_sts1, first_path_index_sts2 : (frames,) array or None
    odometry_position_m, odometry_yaw_rad : array or None
    receivers : tuple of str
        All receivers in the file this capture came from.
    background : Capture or None
        What the same radar on the same robot recorded with nothing in view, with noise of its own. Shown to stages that
        need a ``background``.
    anchors : Anchors or None
        Anchors around the receiver, and what it heard of them.
    """

    preamble: Samples
    sts1: Samples | None = None
    sts2: Samples | None = None
    first_path_index: FloatArray | None = None
    first_path_index_sts1: FloatArray | None = None
    first_path_index_sts2: FloatArray | None = None
    odometry_position_m: FloatArray | None = None
    odometry_yaw_rad: FloatArray | None = None
    receivers: tuple[str, ...] = field(default=())
    background: Capture | None = None
    anchors: Anchors | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        lock_fields(self, ("preamble", "sts1", "sts2", *PER_FRAME))
        if len(self.preamble.shape) != 2:
            raise CaptureError(f"capture '{self.name}': samples have shape (frames, taps), not {self.preamble.shape}")
        frames, taps = self.preamble.shape
        objects = self.truth.objects if self.truth is not None else ()
        try:
            check_shape(frames, taps)
            check_truth(len(objects), max((obstacle.outline_m.shape[-2] for obstacle in objects), default=0))
            check_places("position_m", self.trajectory.position_m)
            if self.odometry_position_m is not None:
                check_places("odometry_position_m", self.odometry_position_m)
            for obstacle in objects:
                check_places(f"the outline of '{obstacle.name}'", obstacle.outline_m)
        except CaptureError as error:
            raise CaptureError(f"capture '{self.name}': {error}") from None
        if taps != self.radar.taps:
            raise CaptureError(f"capture '{self.name}': frames have {taps} taps, the radar says {self.radar.taps}")
        if (self.sts1 is None) != (self.sts2 is None):
            raise CaptureError(f"capture '{self.name}': one STS response without the other")
        for name in ("sts1", "sts2"):
            samples = getattr(self, name)
            if samples is not None and samples.shape != self.preamble.shape:
                shapes = f"{samples.shape}, the preamble {self.preamble.shape}"
                raise CaptureError(f"capture '{self.name}': {name} has shape {shapes}")
        if self.radar.has_sts != (self.sts1 is not None):
            raise CaptureError(f"capture '{self.name}': radar.has_sts disagrees with the samples given")
        if self.radar.has_first_path != (self.first_path_index is not None):
            raise CaptureError(f"capture '{self.name}': radar.has_first_path disagrees with the data given")
        counts = {"timestamp_s": len(self.trajectory.timestamp_s), "position_m": len(self.trajectory.position_m)}
        counts["yaw_rad"] = len(self.trajectory.yaw_rad)
        for name in PER_FRAME:
            value = getattr(self, name)
            if value is not None:
                counts[name] = value.shape[0]
        for obstacle in objects:
            if obstacle.moves:
                counts[f"outline of '{obstacle.name}'"] = len(obstacle.outline_m)
        wrong = {name: count for name, count in counts.items() if count != frames}
        if wrong:
            raise CaptureError(f"capture '{self.name}': preamble has {frames} frames, but {wrong}")
        times = self.trajectory.timestamp_s
        if len(times) and not (np.all(np.isfinite(times)) and np.all(np.diff(times) >= 0)):
            bad = (
                int(np.argmin(np.diff(times) >= 0)) + 1
                if np.all(np.isfinite(times))
                else int(np.argmin(np.isfinite(times)))
            )
            raise CaptureError(
                f"capture '{self.name}': timestamp_s must be finite and not decrease; frame {bad} breaks that"
            )
        if self.anchors is not None:
            outside = self.anchors.frame[(self.anchors.frame < 0) | (self.anchors.frame >= frames)]
            if len(outside):
                raise CaptureError(f"capture '{self.name}': an anchor is heard in frame {outside[0]} of {frames}")
        if self.background is not None:
            self._check_background(self.background)

    def _check_background(self, background: Capture) -> None:
        """Refuse what is no background of this capture's radar."""
        pair = f"capture '{self.name}': '{background.name}' cannot be its background"
        if background.background is not None:
            raise CaptureError(f"{pair}: it has a background itself")
        if not len(background):
            raise CaptureError(f"{pair}: it has no frames")
        differing = self.radar.differences(background.radar)
        if differing:
            values = ", ".join(f"{name} {theirs!r} instead of {own!r}" for name, (own, theirs) in differing.items())
            raise CaptureError(f"{pair}: it is of another radar, with {values}")
        if self.robot and background.robot and self.robot != background.robot:
            raise CaptureError(f"{pair}: it is of another robot, '{background.robot}' instead of '{self.robot}'")

    @property
    def header(self) -> CaptureHeader:
        """The capture without its samples."""
        return CaptureHeader(**{item.name: getattr(self, item.name) for item in fields(CaptureHeader)})

    def frames(self, start: int = 0, stop: int | None = None, *, sts: bool = True) -> Frames:
        """Frames ``start`` to ``stop`` as complex samples, with the validity mark of each.

        Real RF samples become their analytic signal. Samples that lie in memory, or plainly in a file, are not copied.

        Parameters
        ----------
        start, stop : int
            First frame, and the one behind the last; to the end where left out.
        sts : bool
            Read the STS responses, where the capture has them. Without them ``sts1`` and ``sts2`` are None, and
            ``valid`` judges the preamble alone: a frame whose only fault lies in its STS is then valid.

        Raises
        ------
        CaptureError
            If the file behind the samples is damaged.
        """
        stop = len(self) if stop is None else min(stop, len(self))
        raw = self._rows("preamble", start, stop)
        valid = _finite_frames(raw)
        if self.radar.samples == "rf":
            with np.errstate(invalid="ignore"):  # an infinite sample makes its whole frame NaN, which is marked invalid
                raw = analytic(raw)
        extra: dict[str, Any] = {}
        for name in ("sts1", "sts2") if sts and self.sts1 is not None else ():
            extra[name] = locked(self._rows(name, start, stop))
            valid = valid & _finite_frames(extra[name])
        for name in PER_FRAME:
            if getattr(self, name) is not None:
                extra[name] = getattr(self, name)[start:stop]
        return Frames(
            first=start,
            preamble=locked(raw),
            timestamp_s=self.trajectory.timestamp_s[start:stop],
            position_m=self.trajectory.position_m[start:stop],
            yaw_rad=self.trajectory.yaw_rad[start:stop],
            valid=locked(valid),
            **extra,
        )

    def _rows(self, name: str, start: int, stop: int) -> Any:
        """Rows of samples in the byte order of this machine, each frame in one piece, copied only where they are not.

        Compiled stages want one layout, and would otherwise be compiled again for each.
        """
        try:
            rows = np.asarray(getattr(self, name)[start:stop])
        except (OSError, RuntimeError) as error:  # a compressed array is checked only when it is read
            file = getattr(getattr(self, name), "file", None)
            where = f"{file.filename}: {getattr(self, name).name}" if file else f"capture '{self.name}': {name}"
            raise CaptureError(f"{where}: cannot be read, damaged file ({error})") from error
        return np.ascontiguousarray(rows, dtype=rows.dtype.newbyteorder("="))

    def blocks(self, size: int, *, sts: bool = True) -> Iterator[Frames]:
        """Frames in consecutive blocks of ``size``; the last may be shorter. ``sts`` as in :meth:`frames`."""
        if size < 1:
            raise ValueError(f"a block holds at least one frame, not {size}")
        for start in range(0, len(self), size):
            yield self.frames(start, start + size, sts=sts)

    @cached_property
    def sha256(self) -> str:
        """Hash of the content: radar, poses, truth, samples and background, whatever file they came from."""
        digest = hashlib.sha256(json.dumps(self.radar.to_dict(), sort_keys=True).encode())
        track = self.trajectory
        arrays: list[Samples | None] = [track.timestamp_s, track.position_m, track.yaw_rad]
        arrays += [getattr(self, name) for name in ("preamble", "sts1", "sts2", *PER_FRAME)]
        if self.truth is not None:
            for obstacle in self.truth.objects:
                label = [obstacle.name, obstacle.material, obstacle.structure, self.truth.exhaustive]
                digest.update(json.dumps(label).encode())
                arrays.append(obstacle.outline_m)
        for array in arrays:
            digest.update(b"-" if array is None else str(array.shape).encode())
            for start in range(0, 0 if array is None else array.shape[0], 65536):
                assert array is not None  # noqa: S101
                digest.update(np.ascontiguousarray(array[start : start + 65536]).tobytes())
        if self.background is not None:  # without one, the hash is that of earlier versions
            digest.update(f"background {self.background.sha256}".encode())
        if self.anchors is not None:
            digest.update(f"anchors {self.anchors.sha256}".encode())
        return digest.hexdigest()
