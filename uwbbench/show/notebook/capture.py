"""A capture and its truth in a notebook."""

from __future__ import annotations

import numpy as np

from uwbbench.api.arrays import FloatArray
from uwbbench.api.capture import Capture, CaptureHeader
from uwbbench.api.errors import CaptureError
from uwbbench.api.radar import Radar
from uwbbench.api.truth import Truth
from uwbbench.results.ground_truth import true_ranges
from uwbbench.results.radargram import picture
from uwbbench.show.notebook import elements

WIDTH, HEIGHT, LEFT, BOTTOM = 520, 190, 34, 30
MOST_OBJECTS = 20
COLOURS = ("#0072b2", "#009e73", "#cc79a7", "#56b4e9", "#e69f00")


def capture(shown: CaptureHeader) -> str:
    """HTML of a capture: radar, frames, duration, truth, licence, and its samples over time and range."""
    facts = {
        "radar": _radar(shown.radar),
        "frames": f"{len(shown)} of {shown.radar.taps} taps, {shown.duration_s:.2f} s",
        "receiver": _receiver(shown),
        "truth": truth_line(shown.truth),
        "licence": shown.license,
        "citation": shown.citation,
        "about": shown.description,
    }
    if isinstance(shown, Capture) and shown.background is not None:
        facts["background"] = f"{len(shown.background)} frames with nothing in view"
    if isinstance(shown, Capture) and shown.anchors is not None:
        facts["anchors"] = f"{len(shown.anchors.identity)}, of which {len(shown.anchors.messages)} messages were heard"
    image = _radargram(shown) if isinstance(shown, Capture) else ""
    return elements.frame("capture", shown.name, elements.facts(facts), image, simulated=shown.source == "simulated")


def truth(shown: Truth) -> str:
    """HTML of ground truth: its objects, and whether they are all that is visible."""
    rows = [
        (
            obstacle.name,
            obstacle.material,
            "structure" if obstacle.structure else "obstacle",
            _extent(obstacle.outline_m),
        )
        for obstacle in shown.objects[:MOST_OBJECTS]
    ]
    left = len(shown.objects) - len(rows)
    more = [f"{left} more objects"] if left else []
    objects = elements.table(("object", "material", "kind", "outline"), rows)
    return elements.frame("truth", truth_line(shown), objects, elements.notes(more))


def truth_line(shown: Truth | None) -> str:
    """Truth in a few words.

    Examples
    --------
    >>> truth_line(None)
    'none: can be detected on and timed, not scored'
    """
    if shown is None:
        return "none: can be detected on and timed, not scored"
    names = ", ".join(f"{obstacle.name} ({obstacle.material})" for obstacle in shown.objects[:4])
    count = f"{len(shown.objects)} object{'' if len(shown.objects) == 1 else 's'}"
    rest = ", ..." if len(shown.objects) > 4 else ""
    coverage = "exhaustive" if shown.exhaustive else "not exhaustive: precision is undefined"
    return f"{count}: {names}{rest}; {coverage}" if names else f"no object; {coverage}"


def _radar(radar: Radar) -> str:
    channel = f", channel {radar.channel}" if radar.channel else ""
    carrier = f"{radar.center_frequency_hz / 1e6:.1f} MHz, bandwidth {radar.bandwidth_hz / 1e6:.1f} MHz"
    tap = f"a tap every {radar.sample_interval_s * 1e9:.4g} ns, {radar.frame_rate_hz:g} frames/s"
    return f"{radar.model}{channel}, {carrier}, {tap}"


def _receiver(shown: CaptureHeader) -> str:
    radar = shown.radar
    has = [f"range window {radar.window_m:.2f} m", f"TX to RX {radar.baseline_length_m:.3f} m"]
    has += ["two antennas (STS)"] if radar.has_sts else []
    has += ["reported first path"] if radar.has_first_path else []
    others = [name for name in getattr(shown, "receivers", ()) if name != radar.receiver]
    has += [f"the file also holds {', '.join(others)}"] if others else []
    return f"{radar.receiver}: {', '.join(has)}"


def _extent(outline_m: FloatArray) -> str:
    """What an outline is, and its middle where it does not move."""
    vertices = outline_m.shape[-2]
    shape = "point" if vertices == 1 else f"{vertices} vertices"
    if outline_m.ndim == 3:
        return f"{shape}, moves"
    x, y = np.mean(outline_m[:, :2], axis=0)
    return f"{shape} around ({x:.2f}, {y:.2f}) m"


def _radargram(shown: Capture) -> str:
    """Small picture of the samples with the true ranges over them; a sentence where the samples cannot be read."""
    if not len(shown):
        return elements.notes(["no frames"])
    try:
        address, far_m = picture(shown)
    except CaptureError as error:
        return elements.notes([error])
    right, bottom = WIDTH - 6, HEIGHT - BOTTOM
    place = f'x="{LEFT}" y="6" width="{right - LEFT}" height="{bottom - 6}"'
    parts = [f'<image {place} preserveAspectRatio="none" href="{address}"/>', *_truth_lines(shown, far_m)]
    parts += [_label(LEFT - 4, 14, f"{far_m:.1f} m", "end"), _label(LEFT - 4, bottom, "0", "end")]
    parts += [_label(LEFT, bottom + 13, "0 s", "start"), _label(right, bottom + 13, f"{shown.duration_s:.1f} s", "end")]
    middle = (LEFT + right) / 2
    parts.append(_label(middle, bottom + 13, "amplitude, 50 dB from black to white; lines: true ranges", "middle"))
    title = f"<title>Radargram of {elements.text(shown.name)}</title>"
    box = f'viewBox="0 0 {WIDTH} {HEIGHT - BOTTOM + 18}" width="{WIDTH}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" role="img" {box}>{title}{"".join(parts)}</svg>'


def _label(x: float, y: float, words: str, anchor: str) -> str:
    look = 'font-size="9" font-family="sans-serif" fill="currentColor"'
    return f'<text x="{x:g}" y="{y:g}" text-anchor="{anchor}" {look}>{elements.text(words)}</text>'


def _truth_lines(shown: Capture, far_m: float) -> list[str]:
    """True range of each obstacle over time, where it is known, in the window and not hidden."""
    if not far_m > 0:
        return []
    chosen = np.unique(np.linspace(0, len(shown) - 1, min(120, len(shown))).astype(np.int64))
    x = LEFT + (WIDTH - 6 - LEFT) * (chosen + 0.5) / len(shown)
    lines = []
    for number, one in enumerate(true_ranges(shown, frames=chosen)[:MOST_OBJECTS]):
        y = HEIGHT - BOTTOM - (HEIGHT - BOTTOM - 6) * one.range_m / far_m
        seen = np.isfinite(y) & (one.range_m <= far_m)
        path = _path(x, y, seen)
        colour = COLOURS[number % len(COLOURS)]
        look = f'fill="none" stroke="{colour}" stroke-width="1.6" stroke-dasharray="5 3"'
        lines += [f'<path d="{path}" {look}/>'] if path else []
    return lines


def _path(x: FloatArray, y: FloatArray, seen: np.ndarray) -> str:
    """Line through the seen points, broken where some are not."""
    starts = seen & ~np.insert(seen[:-1], 0, False)
    return " ".join(
        f"{'M' if start else 'L'}{a:.1f} {b:.1f}"
        for a, b, start, there in zip(x, y, starts, seen, strict=True)
        if there
    )
