"""Blocks cut in two, for stages that hold frames back."""

from __future__ import annotations

from uwbbench.api import Block


def between(block: Block, start: int, stop: int) -> Block:
    """Frames ``start`` to ``stop`` of a block with all that belongs to them.

    Parameters
    ----------
    block : Block
    start, stop : int
        Counted from its first frame.
    """
    rows = block.rows
    parts = {name: getattr(block, name) for name in ("first_path", "noise_rms", "profile")}
    cut = {name: None if value is None else value[start:stop] for name, value in parts.items()}
    frames = block.frames.part(start, stop)
    detections = block.detections.take((rows >= start) & (rows < stop)).annotated(processed=frames.index)
    return block.replace(frames=frames, detections=detections, **cut)
