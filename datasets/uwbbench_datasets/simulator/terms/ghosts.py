"""Echoes that flew further than to their object and back, and show it where it is not."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from uwbbench.api import (
    SPEED_OF_LIGHT_M_S,
    ComplexArray,
    FloatArray,
    Params,
    Paths,
    SceneObject,
    Term,
    View,
    nearest_on_outline,
)
from uwbbench_datasets.simulator.shapes import Face, faces
from uwbbench_datasets.simulator.terms.echo import (
    CylinderEcho,
    PlateEcho,
    PlateParams,
    PointEcho,
    PointParams,
    reflected,
)
from uwbbench_datasets.simulator.terms.walls import mirrored, reflection_point, walls

_ECHOES = (
    PlateEcho(PlateParams.model_validate({})),
    CylinderEcho(Params()),
    PointEcho(PointParams.model_validate({})),
)
"""Terms that know the echoes of targets, as they are if a scene changes nothing of them."""


@dataclass(frozen=True)
class _Target:
    """One object that is no wall, alone in front of isotropic antennas, with the term that knows its echo."""

    view: View
    echo: PlateEcho | CylinderEcho | PointEcho

    def nearest_m(self) -> FloatArray:
        """Point (frames, 3) of its outline nearest to the receiver, at the receiver's height."""
        receiver = self.view.receiver_m
        outline = self.view.objects[0].obstacle.outline_m[..., :2]
        return np.column_stack([nearest_on_outline(receiver[:, :2], outline), receiver[:, 2]])

    def amplitude(self, rng: np.random.Generator) -> ComplexArray:
        """Its strongest echo (frames,), with the phase of the reflection but not of the way."""
        paths = self.echo.paths(self.view, rng)
        if paths is None:
            return np.zeros(len(self.view), complex)
        turned = paths.amplitude * np.exp(2j * np.pi * self.view.radar.center_frequency_hz * paths.delay_s)
        return np.asarray(turned[np.arange(len(turned)), np.argmax(np.abs(turned), axis=1)])

    def bound(self) -> float:
        """Upper bound of :meth:`amplitude`."""
        return self.echo.bound(self.view)


def _targets(view: View) -> Iterator[_Target]:
    for column, body in enumerate(view.objects):
        alone = view.replace(
            objects=(body,),
            visibility=view.visibility[:, [column]],
            receive_gain=lambda azimuth_rad: np.ones(np.shape(azimuth_rad)),
        )
        for echo in _ECHOES:
            if body.shape in echo.shapes:
                yield _Target(alone, echo)


def _wall_faces(view: View) -> Iterator[tuple[SceneObject, Face]]:
    return ((wall, face) for _, wall in walls(view) for face in faces(wall))


def _distance(one: FloatArray, other: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.norm(one - other, axis=-1))


def _largest_gain(view: View) -> float:
    """Most that the receiving antenna amplifies, to a quarter of a degree."""
    return float(np.max(np.abs(view.receive_gain(np.linspace(-np.pi, np.pi, 1441)))))


class WallGhostParams(Params):
    """How much weaker ghosts are."""

    loss_db: float = Field(0.0, ge=0, description="Beyond the wall's own reflection: 8 dB of concrete, 12 of plaster.")
    twice: bool = Field(False, description="Also those that go out and back by way of the wall.")


class WallGhost(Term[WallGhostParams]):
    """Ghosts of targets in walls: out by way of the wall and back directly, and the other way round.

    The mirror image of the receiver (or transmitter) in the wall gives the length of the way; the ghost shows in the
    direction of the wall's reflection (or of the target). Its strength is that of the target's own echo, spread over
    the longer way, times the wall's reflection. It is there while target and radar stand on one side of the wall and
    the reflection falls on it. Where the scene asks for it, a third ghost goes out and back by way of the wall: the
    target's mirror image, weakened by two reflections.
    """

    def bound(self, view: View) -> float:
        """All ghosts of a frame in phase, with no spreading over the longer way; a wall shows one side at a time."""
        strengths = [abs(self._reflected(view, wall)) for _, wall in walls(view)]
        walls_sum = sum(2 * one + (one**2 if self.params.twice else 0.0) for one in strengths)
        targets_sum = sum(target.bound() for target in _targets(view)) if walls_sum else 0.0
        return walls_sum * targets_sum * _largest_gain(view)

    def _reflected(self, view: View, wall: SceneObject) -> complex:
        return reflected(wall, view.radar.center_frequency_hz) * 10 ** (-self.params.loss_db / 20)

    def paths(self, view: View, rng: np.random.Generator) -> Paths | None:
        """Two or three paths for each target and side of a wall."""
        sides = [(face, self._reflected(view, wall)) for wall, face in _wall_faces(view)]
        lengths, strengths, azimuths = [], [], []
        for target in _targets(view) if sides else ():
            point, echo = target.nearest_m(), target.amplitude(rng)
            toward = view.azimuth_rad(point[:, None])[:, 0]
            direct = _distance(view.transmitter_m, point) + _distance(point, view.receiver_m)
            for face, strength in sides:
                image = mirrored(point, face)
                ways = (
                    (view.receiver_m, view.transmitter_m, view.azimuth_rad(image[:, None])[:, 0]),
                    (view.transmitter_m, view.receiver_m, toward),
                )
                for by_wall, straight, azimuth in ways:
                    length = _distance(straight, point) + _distance(image, by_wall)
                    _, shown = reflection_point(face, point, by_wall)
                    lengths.append(length)
                    strengths.append(shown * strength * echo * direct / np.maximum(length, 1e-9))
                    azimuths.append(azimuth)
                if self.params.twice:
                    length = _distance(view.transmitter_m, image) + _distance(image, view.receiver_m)
                    shown = np.logical_and(*(reflection_point(face, point, by_wall)[1] for by_wall, _, _ in ways))
                    lengths.append(length)
                    strengths.append(shown * strength**2 * echo * direct / np.maximum(length, 1e-9))
                    azimuths.append(ways[0][2])
        return _paths(view, lengths, strengths, azimuths) if lengths else None


class RobotGhostParams(Params):
    """How the robot scatters."""

    rcs_m2: float = Field(0.1, gt=0, description="Radar cross section of the robot, seen from its antennas' side.")


class RobotGhost(Term[RobotGhostParams]):
    """Second echo of strong near targets: from the target to the robot, back to the target and to the receiver.

    With the target's echo ``A`` and a robot of radar cross section ``s`` the radar equation, applied twice, gives
    ``A^2 (4 pi / lambda) sqrt(s / (4 pi))``. As it goes with the square of the echo, it matters for metal within about
    a metre, where it stands at twice the distance.
    """

    def _scale(self, view: View) -> float:
        return float(4 * np.pi / view.radar.wavelength_m * np.sqrt(self.params.rcs_m2 / (4 * np.pi)))

    def bound(self, view: View) -> float:
        """All second echoes of a frame in phase."""
        return self._scale(view) * _largest_gain(view) * sum(target.bound() ** 2 for target in _targets(view))

    def paths(self, view: View, rng: np.random.Generator) -> Paths | None:
        """One path for each target."""
        lengths, strengths, azimuths = [], [], []
        for target in _targets(view):
            point = target.nearest_m()
            lengths.append(_distance(view.transmitter_m, point) + 3 * _distance(point, view.receiver_m))
            strengths.append(self._scale(view) * target.amplitude(rng) ** 2)
            azimuths.append(view.azimuth_rad(point[:, None])[:, 0])
        return _paths(view, lengths, strengths, azimuths) if lengths else None


def _paths(
    view: View, lengths_m: Sequence[FloatArray], strengths: Sequence[ComplexArray], azimuths_rad: Sequence[FloatArray]
) -> Paths:
    """Paths (frames, n) of given lengths, with the receiving antenna's gain and the carrier's phase."""
    delay_s = (np.stack(lengths_m, axis=1) - view.radar.baseline_length_m) / SPEED_OF_LIGHT_M_S
    azimuth_rad = np.stack(azimuths_rad, axis=1)
    carrier = np.exp(-2j * np.pi * view.radar.center_frequency_hz * delay_s)
    return Paths(delay_s, np.stack(strengths, axis=1) * view.receive_gain(azimuth_rad) * carrier, azimuth_rad)
