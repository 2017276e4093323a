"""F1 over the threshold sets of a grid, and the zone in which a choice hardly matters."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np

from uwbbench.api.arrays import BoolArray, FloatArray
from uwbbench.api.errors import ConfigError
from uwbbench.api.text import printable
from uwbbench.show.figures import style
from uwbbench.tools.tune import Tuned, TuneOutcome
from uwbbench.tools.tune.sheets import short

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ACROSS = 3
"""Panels beside each other."""
MOST_PANELS = 60


def draw_stable_zone(outcome: TuneOutcome) -> Figure:
    """Draw F1 for each group and each pair of thresholds, the others as chosen; for one threshold, as a curve.

    Parameters
    ----------
    outcome : TuneOutcome
        Of a grid.

    Raises
    ------
    ConfigError
        If there was no grid, or it would take more than 60 panels.
    """
    sweep = outcome.tuning.sweep
    if sweep is None:
        raise ConfigError("the stable zone is that of a grid; a search has none")
    pairs: list[tuple[int, ...]] = list(itertools.combinations(range(len(sweep.axes)), 2)) or [(0,)]
    if len(pairs) * len(outcome.groups) > MOST_PANELS:
        raise ConfigError(
            f"the figure would take {len(pairs) * len(outcome.groups)} panels, {MOST_PANELS} at most; tune fewer groups"
        )
    columns = min(len(pairs), ACROSS)
    lines = -(-len(pairs) // columns)
    with style.styled():
        drawn = style.figure(
            2.39 * columns + (0.6 if columns < ACROSS else 0), 0.75 + 1.75 * lines * len(outcome.groups)
        )
        grid = drawn.subplots(lines * len(outcome.groups), columns, squeeze=False)
        for number, tuned in enumerate(outcome.groups):
            own = grid[number * lines : (number + 1) * lines].ravel()
            image = None
            for axes, pair in zip(own, pairs, strict=False):
                image = _panel(axes, outcome, tuned, pair) or image
            for axes in own[len(pairs) :]:
                axes.set_visible(False)
            zone = "n/a" if tuned.zone is None else f"{tuned.zone.share:.1%}"
            own[0].set_title(printable(f"{tuned.group.text}: stable zone {zone}"), loc="left")
            if image is not None:
                drawn.colorbar(image, ax=list(own), label="F1", shrink=0.9, pad=0.01)
        style.caption(drawn, _sentences(outcome))
    return drawn


def _panel(axes: Any, outcome: TuneOutcome, tuned: Tuned, pair: tuple[int, ...]) -> Any:
    """One slice through the grid at the chosen set; the picture whose colours the bar explains, if there is one."""
    sweep = outcome.tuning.sweep
    assert sweep is not None  # noqa: S101 - checked by the caller
    assert tuned.zone is not None  # noqa: S101 - a grid has one
    chosen = np.unravel_index(tuned.best, sweep.shape)
    slice_: tuple[Any, ...] = tuple(slice(None) if axis in pair else place for axis, place in enumerate(chosen))
    f1 = tuned.scores.f1.reshape(sweep.shape)[slice_]
    inside = tuned.zone.inside.reshape(sweep.shape)[slice_]
    labels = [short(sweep.axes[axis].path) for axis in pair]
    if len(pair) == 1:
        _curve(axes, sweep.axes[0].thresholds, f1, inside, int(chosen[0]), labels[0])
        return None
    axes.grid(visible=False)
    lowest, highest = float(np.nanmin(tuned.scores.f1)), float(np.nanmax(tuned.scores.f1))
    image = axes.imshow(f1, origin="lower", aspect="auto", cmap="cividis", vmin=lowest, vmax=highest)
    _outline(axes, inside)
    axes.plot(chosen[pair[1]], chosen[pair[0]], "o", mfc="white", mec=style.BLACK, ms=4.5, mew=0.9, zorder=4)
    for axis, ticks, name, label in (
        (axes.xaxis, sweep.axes[pair[1]].thresholds, axes.set_xlabel, labels[1]),
        (axes.yaxis, sweep.axes[pair[0]].thresholds, axes.set_ylabel, labels[0]),
    ):
        places = np.unique(np.linspace(0, len(ticks) - 1, min(len(ticks), 5)).round().astype(int))
        axis.set_ticks(places, ["none" if ticks[at] is None else f"{ticks[at]:.3g}" for at in places])
        name(printable(label))
    return image


def _outline(axes: Any, inside: BoolArray) -> None:
    """Edge of the zone along the cells of the picture."""
    padded = np.pad(inside, 1)
    edges = []
    for row, column in np.argwhere(padded[1:-1, 1:] != padded[1:-1, :-1]):
        edges.append([(column - 0.5, row - 0.5), (column - 0.5, row + 0.5)])
    for row, column in np.argwhere(padded[1:, 1:-1] != padded[:-1, 1:-1]):
        edges.append([(column - 0.5, row - 0.5), (column + 0.5, row - 0.5)])
    from matplotlib.collections import LineCollection

    axes.add_collection(LineCollection(edges, colors=style.VERMILION, linewidths=1.6, capstyle="round", zorder=3))


def _curve(
    axes: Any, thresholds: tuple[float | None, ...], f1: FloatArray, inside: BoolArray, chosen: int, label: str
) -> None:
    """F1 over one threshold."""
    at = np.arange(len(thresholds))
    axes.plot(at, f1, color=style.BLUE)
    axes.plot(at[inside], f1[inside], "s", color=style.VERMILION, ms=3.5)
    axes.plot([chosen], [f1[chosen]], "o", mfc="white", mec=style.BLACK, ms=5, zorder=4)
    places = np.unique(np.linspace(0, len(at) - 1, min(len(at), 7)).round().astype(int))
    axes.set_xticks(places, ["none" if thresholds[place] is None else f"{thresholds[place]:.3g}" for place in places])
    axes.set_xlabel(printable(label))
    axes.set_ylabel("F1")


def _sentences(outcome: TuneOutcome) -> list[str]:
    model, sweep = outcome.tuning.model, outcome.tuning.sweep
    assert sweep is not None  # noqa: S101 - checked by the caller
    sources = {one.capture.source for one in outcome.captures}
    kind = "SIMULATED" if sources == {"simulated"} else "measured" if sources == {"measured"} else "measured, SIMULATED"
    rest = "the thresholds that a panel does not show are as chosen" if len(sweep.axes) > 2 else ""
    return [
        f"F1 of detector {outcome.tuning.detector.name} over {len(sweep)} threshold sets on {len(outcome.captures)} "
        f"{kind} captures, scoring {model.scoring}, gate {model.gate_m:g} m; circle: chosen; red: within "
        f"{model.stable_within:g} of the highest F1{'; ' if rest else ''}{rest}."
    ]
