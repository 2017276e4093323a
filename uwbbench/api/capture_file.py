"""The capture file, version 1, read lazily.

One HDF5 file holds one run of one radar with one or more receivers. Arrays are contiguous and uncompressed, so that
they are read where they lie through a memory map; chunked or compressed arrays are read through HDF5. Files with
objects that move carry version 1.1, which adds a frame axis to ``outline_m``; files with a background version 1.2,
which adds the attribute ``background`` of a receiver; files with anchors version 1.3, which adds the groups
``/anchors`` and ``anchors`` of a receiver; everything else is version 1.0.
"""

from __future__ import annotations

import contextlib
import dataclasses
import os
from pathlib import Path
from typing import Any, cast

import h5py
import numpy as np

from uwbbench.api.anchor_file import read_anchors
from uwbbench.api.apart import examine
from uwbbench.api.arrays import FloatArray
from uwbbench.api.bounds import MOST_RECEIVERS, check_unfolded
from uwbbench.api.capture import Capture, Samples
from uwbbench.api.errors import CaptureError, nearest
from uwbbench.api.mapped import MappedSamples
from uwbbench.api.radar import Radar
from uwbbench.api.text import LONGEST_VALUE, printable, quoted
from uwbbench.api.truth import Obstacle, Trajectory, Truth

FORMAT = "uwbbench-capture"
_REQUIRED = object()
_DAMAGE = (OSError, RuntimeError, KeyError, ValueError, TypeError)
"""What h5py and numpy raise where the metadata of a file are damaged."""
POSITIVE = ("center_frequency_hz", "bandwidth_hz", "sample_interval_s", "frame_rate_hz")
RADAR = ("model", *POSITIVE, "samples", "channel")
RECEIVER_OPTIONAL = ("array_spacing_m", "first_tap_delay_s")
TEXTS = ("citation", "description", "recording", "robot")
"""Texts about a capture that need not be there."""
TRACKS = ("first_path_index", "first_path_index_sts1", "first_path_index_sts2", "odometry_yaw_rad")


class _Reader:
    """One open file, with errors that name the file and the path inside it."""

    def __init__(self, path: Path) -> None:
        self.path = path
        if not path.is_file():
            raise CaptureError(f"{path}: no such capture file")
        try:
            self.file = h5py.File(path, "r")
        except OSError as error:
            raise CaptureError(f"{path}: not a readable HDF5 file, or truncated ({error})") from error

    def fail(self, where: str, text: str) -> CaptureError:
        return CaptureError(f"{self.path}: {where}: {text}")

    def group(self, where: str) -> Any:
        node = self.find(where)
        if not isinstance(node, h5py.Group):
            raise self.fail(where, "expected a group, found nothing" if node is None else "expected a group")
        return node

    def find(self, where: str) -> Any:
        """Object at a path, refusing links that leave the file."""
        here: Any = self.file
        for name in where.strip("/").split("/"):
            if not name:
                continue
            link = here.get(name, getlink=True) if isinstance(here, h5py.Group) else None
            if link is None:
                return None
            if not isinstance(link, h5py.HardLink):  # checked on the link itself: a dangling one is not in its group
                raise self.fail(where, "links are not followed; the data must lie in this file")
            here = here[name]
        return here

    def attribute(self, where: str, name: str, kind: type, default: Any = _REQUIRED) -> Any:
        attributes = self.file.attrs if where == "/" else self.group(where).attrs
        label = f"{where}@{name}"
        if name not in attributes:
            if default is _REQUIRED:
                raise self.fail(label, f"attribute missing; expected {kind.__name__}.{nearest(name, attributes)}")
            return default
        value = attributes[name]
        if isinstance(value, np.ndarray) and value.size == 1:  # as MATLAB writes single values
            value = value.item()
        try:
            if kind is str:
                return value.decode() if isinstance(value, bytes) else str(value)
            if kind is tuple:
                vector = tuple(float(item) for item in np.asarray(value, float).ravel())
                if len(vector) != 3 or not np.all(np.isfinite(vector)):
                    raise self.fail(label, f"expected 3 finite numbers, found {quoted(value)}")
                return vector
            if isinstance(value, str | bytes):
                raise self.fail(label, f"expected {kind.__name__}, found the text {quoted(value)}")
            number = kind(value)
            if kind is float and not np.isfinite(number):
                raise self.fail(label, f"expected a finite number, found {quoted(value)}")
            if kind is not float and number != value:
                raise self.fail(label, f"expected {kind.__name__}, found {quoted(value)}")
            return number
        except (TypeError, ValueError, OverflowError) as error:
            raise self.fail(label, f"expected {kind.__name__}, found {quoted(value)}") from error

    def positive(self, where: str, name: str) -> float:
        """Attribute that must be a positive number."""
        value: float = self.attribute(where, name, float)
        if value <= 0:
            raise self.fail(f"{where}@{name}", f"expected a positive number, found {quoted(value)}")
        return value

    def dataset(self, where: str, *, required: bool = True) -> h5py.Dataset | None:
        node = self.find(where)
        if node is None:
            if required:
                raise self.fail(where, "array missing")
            return None
        if not isinstance(node, h5py.Dataset):
            raise self.fail(where, "expected an array, found a group")
        if node.external or node.is_virtual:
            raise self.fail(where, "the array lies in another file; it must lie in this one")
        stored = self.path.stat().st_size if node.chunks is None else node.id.get_storage_size()
        check_unfolded(f"{self.path}: {where}", node.size * node.dtype.itemsize, stored)
        return node

    def samples(self, where: str, kinds: str, shape: tuple[int, int] | None, *, required: bool) -> Samples | None:
        """Array (frames, taps) of samples, memory-mapped where the layout allows it."""
        array = self.dataset(where, required=required)
        if array is None:
            return None
        if array.ndim != 2 or (shape is not None and array.shape != shape):
            raise self.fail(where, f"expected shape {shape or '(frames, taps)'}, found {array.shape}")
        if array.dtype.kind not in kinds:
            expected = "complex64" if kinds == "c" else "float32 (radar samples are 'rf')"
            raise self.fail(where, f"expected {expected}, found {array.dtype}")
        offset = array.id.get_offset()
        if array.chunks is None and offset is not None and array.size:
            return MappedSamples(self.path, array.dtype, offset, array.shape)
        return cast(Samples, array)

    def track(self, where: str, shape: tuple[int, ...], *, required: bool = False) -> FloatArray | None:
        """Per-frame values, read at once."""
        array = self.dataset(where, required=required)
        if array is None:
            return None
        if array.shape != shape:
            raise self.fail(where, f"expected shape {shape} (as many frames as the preamble), found {array.shape}")
        try:
            return np.asarray(array[...], dtype=np.float64)
        except (TypeError, ValueError, OSError) as error:
            raise self.fail(where, f"expected float64 values: {error}") from error


def open_capture(path: str | os.PathLike[str], receiver: str | None = None) -> Capture:
    """Open a capture file.

    Parameters
    ----------
    path : Path
        An ``.h5`` file in the capture format.
    receiver : str, optional
        Which receiver; may be left out where the file has one.

    Returns
    -------
    Capture
        Samples stay on disk until they are asked for.

    Raises
    ------
    CaptureError
        If the file breaks the format; the message names the path inside the file and what was expected.
    """
    reader = _reader(Path(path))
    try:
        receivers = _receivers(reader)
        if receiver is None:
            if len(receivers) > 1:
                raise reader.fail("/receivers", f"has several receivers, choose one of: {', '.join(receivers)}")
            receiver = receivers[0]
        elif receiver not in receivers:
            raise reader.fail("/receivers", f"no receiver '{receiver}'.{nearest(receiver, receivers)}")
        return _opened(reader, receiver, receivers)
    except CaptureError as error:
        text = str(error)
        raise (error if text.startswith(str(path)) else reader.fail(f"/receivers/{receiver}", text)) from None
    except _DAMAGE as error:
        raise CaptureError(f"{path}: damaged HDF5 file ({error})") from error


def list_receivers(path: str | os.PathLike[str]) -> tuple[str, ...]:
    """Names of the receivers in a capture file, sorted.

    Raises
    ------
    CaptureError
        If the file is not a capture file of a readable version.
    """
    reader = _reader(Path(path))
    try:
        return _receivers(reader)
    except _DAMAGE as error:
        raise CaptureError(f"{path}: damaged HDF5 file ({error})") from error


def _reader(path: Path) -> _Reader:
    """Reader of a file that a child has come through before."""
    if not path.is_file():
        raise CaptureError(f"{path}: no such capture file")
    examine(path, lambda: _come_through(path))
    return _Reader(path)


def _come_through(path: Path) -> None:
    """Do to a file whatever HDF5 will be asked to do: nothing but plainly stored samples is read without it."""
    reader = _Reader(path)
    receivers = _receivers(reader)
    for receiver in receivers:
        with contextlib.suppress(CaptureError, *_DAMAGE):
            capture = _opened(reader, receiver, receivers)
            for part in (capture, capture.background):
                samples = (part.preamble, part.sts1, part.sts2) if part is not None else ()
                for array in samples:
                    if isinstance(array, h5py.Dataset):
                        for start in range(0, len(array), 4096):
                            array[start : start + 4096]


def _opened(reader: _Reader, receiver: str, receivers: tuple[str, ...]) -> Capture:
    """Capture of one receiver of a file, with its background and its anchors."""
    capture = _read(reader, receiver, receivers, f"/receivers/{receiver}")
    parts = {"background": _background(reader, receiver), "anchors": read_anchors(reader, receiver)}
    more: dict[str, Any] = {name: part for name, part in parts.items() if part is not None}
    return dataclasses.replace(capture, **more) if more else capture


def _receivers(reader: _Reader) -> tuple[str, ...]:
    kind = reader.attribute("/", "format", str)
    if kind != FORMAT:
        raise reader.fail("/@format", f"expected '{FORMAT}', found {quoted(kind)}")
    version = reader.attribute("/", "format_version", str)
    if version.split(".")[0] != "1":
        raise reader.fail(
            "/@format_version", f"version {printable(version, LONGEST_VALUE)} is not readable here; expected 1.x"
        )
    receivers = tuple(sorted(reader.group("/receivers")))
    if not receivers:
        raise reader.fail("/receivers", "expected at least one receiver")
    if len(receivers) > MOST_RECEIVERS:
        raise reader.fail("/receivers", f"holds {len(receivers)} receivers, of which there may be {MOST_RECEIVERS}")
    return receivers


def _background(reader: _Reader, receiver: str) -> Capture | None:
    """Background that a receiver names: a group of this file, or a capture file in its folder or below."""
    where = f"/receivers/{receiver}"
    named = reader.attribute(where, "background", str, None)
    if named is None:
        return None
    if named.startswith("/"):
        if reader.find(named) is None:
            raise reader.fail(f"{where}@background", f"names the group '{named}', which is not there")
        return _read(reader, receiver, (receiver,), named, apart=True)
    folder = reader.path.parent
    path = folder / named
    if Path(named).is_absolute() or not path.resolve().is_relative_to(folder.resolve()):
        raise reader.fail(f"{where}@background", f"names the file '{named}', which must lie in this file's folder")
    other = _reader(path)
    names = _receivers(other)
    if receiver not in names:
        raise other.fail("/receivers", f"no receiver '{receiver}', whose background {reader.path} expects here")
    return _read(other, receiver, names, f"/receivers/{receiver}")


def _read(reader: _Reader, receiver: str, receivers: tuple[str, ...], base: str, *, apart: bool = False) -> Capture:
    """One recording of a receiver, without its background.

    Parameters
    ----------
    reader : _Reader
    receiver : str
    receivers : tuple of str
        All of the file.
    base : str
        Group of the recording.
    apart : bool
        The group is of another run than the file: it may state name and frame rate, and holds its truth.
    """
    storage = reader.attribute("/radar", "samples", str)
    if storage not in ("iq", "rf"):
        raise reader.fail("/radar@samples", f"expected 'iq' or 'rf', found {quoted(storage)}")
    preamble = reader.samples(f"{base}/preamble", "c" if storage == "iq" else "fiu", None, required=True)
    assert preamble is not None  # noqa: S101
    shape = (int(preamble.shape[0]), int(preamble.shape[1]))
    if shape[1] == 0:
        raise reader.fail(f"{base}/preamble", f"expected at least one tap, found shape {shape}")
    sts = [reader.samples(f"{base}/{name}", "c", shape, required=False) for name in ("sts1", "sts2")]
    if (sts[0] is None) != (sts[1] is None):
        present = "sts1" if sts[1] is None else "sts2"
        raise reader.fail(f"{base}/{present}", "one STS array without the other; expected both or neither")
    timestamp_s = reader.track(f"{base}/timestamp_s", shape[:1], required=True)
    assert timestamp_s is not None  # noqa: S101
    if np.any(~np.isfinite(timestamp_s)) or np.any(np.diff(timestamp_s) < 0):
        raise reader.fail(f"{base}/timestamp_s", "expected finite times that do not decrease")
    tracks: dict[str, Any] = {name: reader.track(f"{base}/{name}", shape[:1]) for name in TRACKS}
    position_m = reader.track(f"{base}/position_m", (shape[0], 3))
    yaw_rad = reader.track(f"{base}/yaw_rad", shape[:1])
    optional = {name: reader.attribute(base, name, float, None) for name in RECEIVER_OPTIONAL}
    rates = {name: reader.positive("/radar", name) for name in POSITIVE}
    if apart and reader.attribute(base, "frame_rate_hz", float, None) is not None:
        rates["frame_rate_hz"] = reader.positive(base, "frame_rate_hz")
    radar = Radar(
        model=reader.attribute("/radar", "model", str),
        **rates,
        taps=shape[1],
        samples="iq" if storage == "iq" else "rf",
        channel=reader.attribute("/radar", "channel", int, None),
        receiver=receiver,
        mount_position_m=reader.attribute(base, "mount_position_m", tuple),
        mount_yaw_rad=reader.attribute(base, "mount_yaw_rad", float),
        tx_position_m=reader.attribute(base, "tx_position_m", tuple),
        noise_taps=reader.attribute(base, "noise_taps", int),
        **optional,
        has_sts=sts[0] is not None,
        has_first_path=tracks["first_path_index"] is not None,
    )
    source = reader.attribute("/", "source", str)
    if source not in ("measured", "simulated"):
        raise reader.fail("/@source", f"expected 'measured' or 'simulated', found {quoted(source)}")
    name = reader.attribute("/", "name", str)
    texts = {key: reader.attribute("/", key, str, "") for key in TEXTS}
    if apart:
        name = reader.attribute(base, "name", str, f"{name} background")
        texts |= {key: text for key in TEXTS if (text := reader.attribute(base, key, str, None)) is not None}
    return Capture(
        name=name,
        source="measured" if source == "measured" else "simulated",
        license=reader.attribute("/", "license", str),
        **texts,
        radar=radar,
        trajectory=Trajectory(
            timestamp_s,
            np.zeros((shape[0], 3)) if position_m is None else position_m,
            np.zeros(shape[0]) if yaw_rad is None else yaw_rad,
        ),
        truth=_read_truth(reader, f"{base}/truth" if apart else "/truth", shape[0]),
        preamble=preamble,
        sts1=sts[0],
        sts2=sts[1],
        **tracks,
        odometry_position_m=reader.track(f"{base}/odometry_position_m", (shape[0], 3)),
        receivers=receivers,
    )


def _read_truth(reader: _Reader, base: str, frames: int) -> Truth | None:
    if reader.find(base) is None:
        return None
    objects = []
    names = sorted(reader.group(f"{base}/objects")) if reader.find(f"{base}/objects") is not None else []
    for name in names:
        where = f"{base}/objects/{name}"
        material = reader.attribute(where, "material", str)
        outline = reader.dataset(f"{where}/outline_m")
        assert outline is not None  # noqa: S101
        values = np.asarray(outline[...], dtype=np.float64) if outline.dtype.kind in "fiu" else np.empty(0)
        fits = values.ndim in (2, 3) and values.shape[-1] in (2, 3) and values.shape[-2] >= 1
        if not fits or (values.ndim == 3 and len(values) != frames):
            expected = f"float64 [vertices, 2 or 3], or [{frames} frames, vertices, 2 or 3]"
            raise reader.fail(f"{where}/outline_m", f"expected {expected}, found {outline.dtype} {outline.shape}")
        if values.ndim == 2 and not np.all(np.isfinite(values)):
            raise reader.fail(f"{where}/outline_m", "expected finite coordinates")
        objects.append(Obstacle(name, material, values, bool(reader.attribute(where, "structure", bool, False))))
    return Truth(tuple(objects), bool(reader.attribute(base, "exhaustive", bool)))
