"""The capture file, written whole or not at all."""

from __future__ import annotations

import contextlib
import os
import uuid
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from uwbbench.api.anchor_file import same_places, write_anchors
from uwbbench.api.apart import trust
from uwbbench.api.capture import Capture
from uwbbench.api.capture_file import FORMAT, RADAR, RECEIVER_OPTIONAL, TEXTS, TRACKS
from uwbbench.api.errors import CaptureError
from uwbbench.api.truth import Truth


def write_capture(path: str | os.PathLike[str], *captures: Capture) -> None:
    """Write one run, one capture for each receiver, into a capture file.

    The file appears complete or not at all: it is written beside its place and then renamed.

    Parameters
    ----------
    path : Path
        File to write; an existing one is replaced.
    *captures : Capture
        Receivers of the same run; their ``radar.receiver`` names differ.

    Raises
    ------
    CaptureError
        If the folder cannot be written to, or the receivers do not belong together.
    """
    target = Path(path)
    names = [capture.radar.receiver for capture in captures]
    if not captures or len(set(names)) != len(names) or any(not _storable(name) for name in names):
        raise CaptureError(f"{target}: a capture file needs receivers with distinct names without '/', not {names}")
    _check_belong_together(target, captures)
    partial = target.with_name(f".{target.name}-{uuid.uuid4().hex}.part")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with h5py.File(partial, "x") as file:
            _write(file, captures)
        partial.replace(target)
        trust(target)
    except (OSError, RuntimeError) as error:  # HDF5 reports a full disk as either
        raise CaptureError(f"{target}: cannot be written: {error}") from error
    finally:
        with contextlib.suppress(OSError):  # a folder that cannot be looked into holds no partial file either
            partial.unlink(missing_ok=True)


def _storable(name: str) -> bool:
    """Whether a name can stand for a group in the file."""
    return bool(name) and "/" not in name and name != "."


def _check_belong_together(target: Path, captures: Sequence[Capture]) -> None:
    """Refuse captures that differ in what a file stores once for all its receivers."""
    first = captures[0]
    for other in captures[1:]:
        differing = [name for name in RADAR if getattr(other.radar, name) != getattr(first.radar, name)]
        if _stored(first.truth) != _stored(other.truth):
            differing.append("truth")
        if not all(same_places(other.anchors, one.anchors) for one in captures):
            differing.append("anchors")
        differing += [name for name in ("recording", "robot") if getattr(other, name) != getattr(first, name)]
        if differing:
            names = f"'{first.radar.receiver}' and '{other.radar.receiver}'"
            raise CaptureError(f"{target}: receivers {names} are not of one run: they differ in {', '.join(differing)}")


def _stored(truth: Truth | None) -> list[Any]:
    """All that a file keeps of a truth, as values that compare."""
    objects = truth.objects if truth is not None else ()
    outlines = [np.asarray(obstacle.outline_m, np.float64) for obstacle in objects]
    labels = [(obstacle.name, obstacle.material, obstacle.structure) for obstacle in objects]
    return [truth and truth.exhaustive, labels, [(outline.shape, outline.tobytes()) for outline in outlines]]


def _write(file: h5py.File, captures: Sequence[Capture]) -> None:
    first = captures[0]
    file.attrs.update({"format": FORMAT, "format_version": _version(captures), "name": first.name})
    file.attrs.update({"source": first.source, "license": first.license})
    file.attrs.update({name: text for name in TEXTS if (text := getattr(first, name))})
    radar = file.create_group("radar")
    radar.attrs.update({name: value for name in RADAR if (value := getattr(first.radar, name)) is not None})
    for capture in captures:
        name = capture.radar.receiver
        group = file.create_group(f"receivers/{name}")
        _write_receiver(group, capture)
        if capture.background is not None:
            group.attrs["background"] = f"/backgrounds/{name}"
            _write_background(file.create_group(f"backgrounds/{name}"), capture.background)
    write_anchors(file, captures)
    if first.truth is not None:
        _write_truth(file.create_group("truth"), first.truth)


def _version(captures: Sequence[Capture]) -> str:
    """Least version of the format that has all that these captures hold."""
    if any(capture.anchors is not None for capture in captures):
        return "1.3"
    if any(capture.background is not None for capture in captures):
        return "1.2"
    truth = captures[0].truth
    return "1.1" if truth is not None and any(obstacle.moves for obstacle in truth.objects) else "1.0"


def _write_background(group: h5py.Group, background: Capture) -> None:
    """A background, with what it does not share with the capture."""
    group.attrs.update({"name": background.name, "frame_rate_hz": background.radar.frame_rate_hz})
    group.attrs.update({name: getattr(background, name) for name in TEXTS})
    _write_receiver(group, background)
    if background.truth is not None:
        _write_truth(group.create_group("truth"), background.truth)


def _write_truth(group: h5py.Group, truth: Truth) -> None:
    group.attrs["exhaustive"] = truth.exhaustive
    group.create_group("objects")
    for obstacle in truth.objects:
        if not _storable(obstacle.name):
            raise CaptureError(f"object name '{obstacle.name}' cannot be stored: it must not be empty or hold '/'")
        item = group.create_group(f"objects/{obstacle.name}")
        item.attrs["material"] = obstacle.material
        if obstacle.structure:
            item.attrs["structure"] = True
        item.create_dataset("outline_m", data=np.asarray(obstacle.outline_m, np.float64))


def _write_receiver(group: h5py.Group, capture: Capture) -> None:
    radar = capture.radar
    for name in ("mount_position_m", "mount_yaw_rad", "tx_position_m", "noise_taps"):
        group.attrs[name] = getattr(radar, name)
    group.attrs.update({name: value for name in RECEIVER_OPTIONAL if (value := getattr(radar, name)) is not None})
    present = [name for name in ("preamble", "sts1", "sts2") if getattr(capture, name) is not None]
    for name in present:
        samples = getattr(capture, name)
        kind = np.dtype(np.float32 if radar.samples == "rf" and name == "preamble" else np.complex64)
        stored = group.create_dataset(name, shape=samples.shape, dtype=kind)
        for start in range(0, samples.shape[0], 65536):
            stored[start : start + 65536] = samples[start : start + 65536]
    for name in ("timestamp_s", "position_m", "yaw_rad"):
        group.create_dataset(name, data=np.asarray(getattr(capture.trajectory, name), np.float64))
    for name in (*TRACKS, "odometry_position_m"):
        values = getattr(capture, name)
        if values is not None:
            group.create_dataset(name, data=np.asarray(values, np.float64))
