"""The worst flipped frame as a picture: its response, and the frames around it, with truth and both detections."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from uwbbench.api.arrays import FloatArray, IntArray
from uwbbench.api.block import Block
from uwbbench.api.capture import Capture
from uwbbench.api.errors import CaptureError
from uwbbench.measure.accuracy.region import Region
from uwbbench.measure.accuracy.scene import Scene
from uwbbench.results import radargram
from uwbbench.results.comparison.flips import Flip
from uwbbench.show.figures import style
from uwbbench.show.text.numbers import number

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

AROUND = 60
"""Frames before and after that are shown."""

FLOOR_DB = -60.0
SIDES = (("first run", style.BLUE, "o"), ("second run", style.VERMILION, "x"))


def draw_flip(flip: Flip, region: Region, roots: Sequence[Path]) -> tuple[Figure, str]:
    """Draw a frame; without its response where the capture is not at hand.

    Parameters
    ----------
    flip : Flip
    region : Region
        Whose obstacles are to be found.
    roots : sequence of Path
        Folders in which the capture is looked for.

    Returns
    -------
    drawn : Figure
    missing : str
        Why the response is not shown; empty if it is.
    """
    unit = flip.unit
    scene = Scene.of(unit.detections[0], unit.header)
    true_m = np.where(scene.visible(region), scene.sight.range_m, np.nan)
    capture, missing = _at_hand(flip, roots)
    with style.styled():
        drawn = style.figure(style.PAGE_IN, 4.4 if capture is not None else 2.8)
        axes = drawn.subplots(1 if capture is None else 2, squeeze=False)[:, 0]
        if capture is not None:
            _response(axes[0], capture, flip, true_m[flip.frame])
        _around(axes[-1], flip, true_m)
        kind = "SIMULATED capture" if unit.header.source == "simulated" else "Measured capture"
        about = f"{kind} {unit.capture} of {unit.dataset}, detector {unit.detector}: frame {flip.frame}"
        style.caption(drawn, [f"{about} went from {flip.before} to {flip.after}.", _errors(flip)])
    return drawn, missing


def _errors(flip: Flip) -> str:
    errors = [
        "nothing" if np.isnan(e) else number(e, 1, 100.0, "cm") for e in (flip.error_before_m, flip.error_after_m)
    ]
    return f"Largest error before: {errors[0]}; after: {errors[1]}."


def _at_hand(flip: Flip, roots: Sequence[Path]) -> tuple[Capture | None, str]:
    folder, entry = flip.unit.folders[0], flip.unit.entries[0]
    used = next(one for one in folder.manifest["experiment"]["datasets"] if one["label"] == entry.dataset)
    try:
        return radargram.reopened(used, entry.capture, folder.content(entry.capture_id), roots), ""
    except CaptureError as error:
        return None, f"the response is not shown: {error}"


def _response(axes: Axes, capture: Capture, flip: Flip, true_m: FloatArray) -> None:
    """Amplitude of the frame over range, with the ranges that are true and those that were found."""
    radar = capture.radar
    blocks = [Block(capture.frames(flip.frame, flip.frame + 1))]
    range_m = np.linspace(0.0, radar.window_m, 8 * radar.taps)
    (level_db,), origin = radargram.levels(blocks, radar, range_m, np.array([flip.frame]), FLOOR_DB)
    axes.plot(range_m, level_db, color=style.BLACK)
    handles: list[Any] = []
    names: list[str] = []
    for at in true_m[np.isfinite(true_m)]:
        handles.append(axes.axvline(at, color=style.GREEN, linewidth=2.0))
        names.append("true range")
    for detections, (name, colour, marker) in zip(flip.unit.detections, SIDES, strict=True):
        here = detections.range_m[detections.frame == flip.frame]
        if len(here):
            height = np.interp(here, range_m, level_db)
            handles += axes.plot(here, height, marker, color=colour, fillstyle="none", markersize=7)
            names.append(name)
    first = {name: handle for handle, name in zip(handles, names, strict=True)}
    style.legend(axes, list(first.values()), list(first), loc="upper right")
    axes.set(xlabel=f"Range (m), delays from {origin}", ylabel="Amplitude (dB)", xlim=(0.0, radar.window_m))


def _around(axes: Axes, flip: Flip, true_m: FloatArray) -> None:
    """Ranges in the frames around."""
    start, stop = max(0, flip.frame - AROUND), min(len(true_m), flip.frame + AROUND + 1)
    frames: IntArray = np.arange(start, stop, dtype=np.int64)
    lines = axes.plot(frames, true_m[start:stop], color=style.GREEN, linewidth=2.0)
    handles, names = lines[:1], ["true range"][: len(lines[:1])]
    for detections, (name, colour, marker) in zip(flip.unit.detections, SIDES, strict=True):
        inside = (detections.frame >= start) & (detections.frame < stop)
        handles += axes.plot(
            detections.frame[inside], detections.range_m[inside], marker, color=colour, fillstyle="none"
        )
        names.append(name)
    handles.append(axes.axvline(flip.frame, color=style.GREY, linestyle=":"))
    names.append(f"frame {flip.frame}")
    style.legend(axes, handles, names, loc="upper right", ncols=2)
    axes.set(xlabel="Frame", ylabel="Range (m)", xlim=(start, stop - 1))
