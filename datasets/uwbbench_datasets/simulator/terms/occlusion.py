"""Objects that hide others."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from uwbbench.api import BoolArray, Params, Term, View, nearest_on_outline, segments_cross


class OcclusionParams(Params):
    """What is left of hidden objects."""

    transmission_db: float | None = Field(
        None, le=0, description="What passes a hiding object, there and back, in power; nothing if left out."
    )


class Occlusion(Term[OcclusionParams]):
    """Objects hidden by others, seen from above, contribute nothing.

    An object is hidden where another outline stands between its nearest point and the receiver or the transmitter.
    The nearest point decides because an echo comes from the first Fresnel zone around it; and by the same point the
    ground truth calls an object occluded.
    """

    def prepare(self, view: View, rng: np.random.Generator) -> View:
        """Weaken each object in the frames in which it is hidden."""
        left = 0.0 if self.params.transmission_db is None else 10 ** (self.params.transmission_db / 20)
        return view.replace(visibility=view.visibility * np.where(hidden(view), left, 1.0))


def hidden(view: View) -> BoolArray:
    """Whether each object (frames, objects) is hidden from the receiver or the transmitter."""
    blocked = np.zeros((len(view), len(view.objects)), bool)
    receiver, transmitter = view.receiver_m[:, :2], view.transmitter_m[:, :2]
    opaque = [body.obstacle.outline_m[..., :2] for body in view.objects]
    for column, body in enumerate(view.objects):
        point = nearest_on_outline(receiver, opaque[column])
        for other, outline in zip(view.objects, opaque, strict=True):
            if other is not body and outline.shape[-2] > 1:
                blocked[:, column] |= segments_cross(receiver, point, outline)
                blocked[:, column] |= segments_cross(transmitter, point, outline)
    return blocked
