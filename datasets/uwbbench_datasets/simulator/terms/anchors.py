"""What a receiver hears of anchors."""

from __future__ import annotations

import dataclasses

import numpy as np
from pydantic import Field

from uwbbench.api import (
    Anchors,
    BoolArray,
    Capture,
    CaptureError,
    FloatArray,
    IntArray,
    Messages,
    Params,
    SceneAnchor,
    Term,
    View,
    segments_cross,
    wrap_angle,
)


class AnchorMessagesParams(Params):
    """How well, how far and how often anchors are heard."""

    azimuth_sd_deg: float = Field(5.0, ge=0, description="Standard deviation of the direction.")
    range_sd_m: float | None = Field(
        0.10, ge=0, description="Standard deviation of the distance; null: only directions are measured."
    )
    range_bias_m: float = Field(
        0.18, description="By how much distances are too long; 18 cm were measured on a link of two DW1000."
    )
    field_of_view_deg: float = Field(45.0, gt=0, le=180, description="Heard up to so far from the boresight.")
    nearest_m: float = Field(1.0, ge=0, description="Heard from here on,")
    farthest_m: float = Field(10.0, gt=0, description="and up to here.")
    rate_hz: float = Field(10.0, gt=0, le=1000, description="Messages of each anchor a second.")
    wrong_identity: float = Field(
        0.0, ge=0, le=1, description="Probability that a message carries the identity of another anchor."
    )


class AnchorMessages(Term[AnchorMessagesParams]):
    """Messages of the scene's anchors, with direction and distance as a receiver with two antennas measures them.

    An anchor is heard where it is near enough, within the field of view and not hidden by an object. It sends at a
    constant rate, with a phase of its own; a message belongs to the first frame that does not precede it. The scene's
    first receiver also reports when the robot sets an anchor down: with the place that the robot believes in. Such a
    message has no error of its own, and always the right identity; the error is that of the anchor's true place.

    Where the scene has no other anchor whose identity a message could carry, a wrong one is that of no anchor.
    """

    def prepare(self, view: View, rng: np.random.Generator) -> View:
        """Look where the receiver is."""
        self._view = view
        return view

    def record(self, capture: Capture, rng: np.random.Generator) -> Capture:
        """Add the messages, frame by frame."""
        view, p = self._view, self.params
        if len(capture) != len(view):
            raise CaptureError("term 'anchor.messages' must stand before those that lose or repeat frames")
        heard = [self._heard(anchor, view, rng) for anchor in view.anchors]
        frame = np.concatenate([np.zeros(0, np.int64), *heard])
        which = np.repeat(np.arange(len(heard)), [len(frames) for frames in heard])
        places_m = np.array([anchor.position_m for anchor in view.anchors]).reshape(-1, 2)
        range_m, azimuth_rad = _seen(places_m[which], frame, view)
        azimuth_rad = wrap_angle(azimuth_rad + np.radians(p.azimuth_sd_deg) * rng.standard_normal(len(frame)))
        noise_m = rng.standard_normal(len(frame))
        range_m = np.full(len(frame), np.nan) if p.range_sd_m is None else self._measured(range_m, noise_m)
        identity = np.array([anchor.identity for anchor in view.anchors], np.int64)
        carried = self._carried(identity, which, rng)
        measured = Messages(carried, azimuth_rad, range_m, np.zeros(len(frame), np.bool_))
        frames, messages = _with_placed(view, frame, measured)
        return dataclasses.replace(capture, anchors=Anchors(identity, places_m, frames, messages))

    def _heard(self, anchor: SceneAnchor, view: View, rng: np.random.Generator) -> IntArray:
        """Frames in which an anchor is heard, once for each message."""
        p, times = self.params, view.timestamp_s
        start_s = times[0] + rng.uniform() / p.rate_hz
        sent_s = np.arange(start_s, times[-1], 1 / p.rate_hz)
        frame = np.searchsorted(times, sent_s)
        frame = frame[(frame >= anchor.frame) & (frame < len(times))]
        range_m, azimuth_rad = _seen(anchor.position_m, frame, view)
        near = (range_m >= p.nearest_m) & (range_m <= p.farthest_m)
        frame = frame[near & (np.abs(azimuth_rad) <= np.radians(p.field_of_view_deg))]
        return np.asarray(frame[~_hidden(anchor.position_m, frame, view)])

    def _measured(self, range_m: FloatArray, noise_m: FloatArray) -> FloatArray:
        """Distances (n,) with their bias and error; none is below zero."""
        spread_m = self.params.range_sd_m or 0.0
        return np.maximum(range_m + self.params.range_bias_m + spread_m * noise_m, 0.0)

    def _carried(self, identity: IntArray, which: IntArray, rng: np.random.Generator) -> IntArray:
        """Identity in each message (n,), here and there that of another anchor."""
        if not len(identity):
            return np.zeros(0, np.int64)
        wrong = rng.random(len(which)) < self.params.wrong_identity
        others = rng.integers(1, max(len(identity), 2), len(which))
        if len(identity) == 1:
            return np.where(wrong, identity[which] + 1, identity[which])
        return identity[np.where(wrong, (which + others) % len(identity), which)]


def _seen(place_m: FloatArray, frame: IntArray, view: View) -> tuple[FloatArray, FloatArray]:
    """Distance and azimuth (n,) of places (n, 2) or one place (2,), from the receiver in the given frames (n,)."""
    away = place_m - view.receiver_m[frame, :2]
    azimuth_rad = wrap_angle(np.arctan2(away[:, 1], away[:, 0]) - view.boresight_rad[frame])
    return np.hypot(away[:, 0], away[:, 1]), azimuth_rad


def _hidden(place_m: FloatArray, frame: IntArray, view: View) -> BoolArray:
    """Whether an object stands between a place and the receiver in each of the frames (n,)."""
    receiver_m = view.receiver_m[frame, :2]
    hidden = np.zeros(len(frame), np.bool_)
    for body in view.objects:
        outline_m = body.obstacle.outline_m[..., :2]
        if outline_m.shape[-2] > 1:
            seen_m = outline_m[frame] if body.obstacle.moves else outline_m
            hidden |= segments_cross(receiver_m, np.broadcast_to(place_m, receiver_m.shape), seen_m)
    return hidden


def _with_placed(view: View, frame: IntArray, measured: Messages) -> tuple[IntArray, Messages]:
    """Frames and messages in the order of the frames, with one for each anchor that the robot has set down."""
    radar = view.radar
    dropped = [anchor for anchor in view.anchors if anchor.offset_m is not None]
    away = np.array([anchor.offset_m for anchor in dropped]).reshape(-1, 2) - np.array(radar.mount_position_m[:2])
    azimuth_rad = wrap_angle(np.arctan2(away[:, 1], away[:, 0]) - radar.mount_yaw_rad)
    frames = np.concatenate([np.array([anchor.frame for anchor in dropped], np.int64), frame])
    order = np.argsort(frames, kind="stable")
    joined = Messages(
        np.concatenate([np.array([anchor.identity for anchor in dropped], np.int64), measured.anchor]),
        np.concatenate([azimuth_rad, measured.azimuth_rad]),
        np.concatenate([np.hypot(away[:, 0], away[:, 1]), measured.range_m]),
        np.concatenate([np.ones(len(dropped), np.bool_), measured.placed]),
    )
    return frames[order], joined.take(order)
