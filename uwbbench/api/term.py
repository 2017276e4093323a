"""One part of a simulated scene: what a term declares, what it sees, and what it adds.

A simulated frame is a sum of pulses, one for each path from the transmitter to a receiver, that a receiver then
distorts. Everything in it comes from terms; a scene names those it wants, and what is not named costs nothing.

Delays count from the crest of the direct path. Amplitudes are field strengths in units where a free-space path of
length ``d`` between isotropic antennas has ``wavelength / (4 pi d)``.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Generic, Literal, Protocol

import numpy as np
from pydantic import Field, model_validator

from uwbbench.api.arrays import ComplexArray, FloatArray
from uwbbench.api.capture import Capture
from uwbbench.api.geometry import SPEED_OF_LIGHT_M_S, rotate_z
from uwbbench.api.radar import Radar
from uwbbench.api.stage import Fidelity, P, Params, params_type_of
from uwbbench.api.truth import Obstacle

Shape = Literal["plate", "box", "rod", "wall", "person", "point"]
"""Plates and walls are flat, boxes have four faces, rods and persons are upright cylinders."""


class Pulse(Protocol):
    """Shape of one echo on the taps: real, with unit height at time zero."""

    @property
    def support_s(self) -> float:
        """Time on either side of the crest beyond which the pulse is nothing."""

    def __call__(self, time_s: FloatArray, /) -> FloatArray:
        """Height at the given times."""


class EchoTail(Params):
    """Returns from behind the face of an object: its back, its edges, what bounces inside.

    They lie on the line of sight behind the point that the object's strongest echo comes from. Their power falls with
    the depth; their phases are the object's own, the same in all runs.
    """

    level_db: float = Field(-6.0, description="Power of all returns together against the object's strongest echo.")
    from_m: float = Field(0.2, ge=0, description="Depth of the first return behind the face.")
    to_m: float = Field(0.5, ge=0, description="Depth of the last.")
    returns: int = Field(4, ge=1, le=100, description="Number of returns, evenly spaced.")
    decay_m: float = Field(0.3, gt=0, description="Depth over which the power falls by a factor e.")
    length_m: float | None = Field(
        None, gt=0, description="Distance over which a moving receiver sees them fade; steady if left out."
    )
    seed: int = Field(0, ge=0, description="Other phases for the same object.")

    @model_validator(mode="after")
    def _ordered(self) -> EchoTail:
        if self.to_m < self.from_m:
            raise ValueError(f"to_m ({self.to_m:g}) must not lie before from_m ({self.from_m:g})")
        return self


class EchoFading(Params):
    """Slow rise and fall of an object's echo along the way of the receiver (speckle), the same in all runs."""

    sd_db: float = Field(3.0, ge=0, description="Standard deviation of the level.")
    length_m: float = Field(0.3, gt=0, description="Distance over which it becomes another.")
    seed: int = Field(0, ge=0, description="Another pattern for the same object.")


@dataclass(frozen=True)
class SceneObject:
    """One object of a scene, as terms see it.

    Attributes
    ----------
    obstacle : Obstacle
        Name, material and outline, as in the ground truth.
    shape : str
        ``plate``, ``box``, ``rod``, ``wall``, ``person`` or ``point``.
    center_m : (3,) or (frames, 3) array
        Centre of the body in the world; with a frame axis it moves, and so does its outline.
    yaw_rad : float
        Heading of its front: the outward normal of a plate's or wall's front face.
    width_m, depth_m, height_m : float
        Full sizes across the normal, along it, and upwards; a cylinder's diameter is width and depth.
    thickness_m : float or None
        Wall thickness for the reflection of a slab; None for a body that waves do not come out of again.
    loss_db : float or None
        What the body loses against an ideal one of its material; None for what is usual of the material.
    fading : EchoFading or None
    tail : EchoTail or None
    bearing_bias_rad, bearing_sd_rad, bearing_length_m : float
        Error of the direction that its echoes seem to come from: constant part, standard deviation of the rest, and
        the distance over which that becomes another.
    """

    obstacle: Obstacle
    shape: Shape
    center_m: FloatArray
    yaw_rad: float
    width_m: float
    depth_m: float
    height_m: float
    thickness_m: float | None = None
    loss_db: float | None = None
    fading: EchoFading | None = None
    tail: EchoTail | None = None
    bearing_bias_rad: float = 0.0
    bearing_sd_rad: float = 0.0
    bearing_length_m: float = 0.05

    @property
    def name(self) -> str:
        """Identifier inside the scene."""
        return self.obstacle.name

    @property
    def material(self) -> str:
        """Name of the material."""
        return self.obstacle.material

    @property
    def structure(self) -> bool:
        """Whether it is a wall or the like, which no detector is asked to find."""
        return self.obstacle.structure

    def part(self, start: int, stop: int) -> SceneObject:
        """The object in frames ``start`` to ``stop``."""
        if not self.obstacle.moves:
            return self
        obstacle = dataclasses.replace(self.obstacle, outline_m=self.obstacle.outline_m[start:stop])
        return dataclasses.replace(self, obstacle=obstacle, center_m=self.center_m[start:stop])


@dataclass(frozen=True)
class SceneAnchor:
    """An anchor of a scene, as terms see it.

    Attributes
    ----------
    identity : int
    position_m : (2,) array
        Where it stands in the world.
    frame : int
        First frame in which it stands there.
    offset_m : (2,) array or None
        Where the robot, in its own frame, believes that it has set it down in that frame. None for an anchor that has
        always been there, and for receivers that do not report the robot's doing.
    """

    identity: int
    position_m: FloatArray
    frame: int = 0
    offset_m: FloatArray | None = None


@dataclass(frozen=True)
class Paths:
    """Ways over which the signal reaches the receiver.

    Attributes
    ----------
    delay_s : (frames or 1, paths) array
        Delay after the direct path's crest.
    amplitude : (frames or 1, paths) complex array
        Strength with the carrier's phase, antenna gains included.
    azimuth_rad : (frames or 1, paths) array
        Direction of arrival from boresight, positive to the left; sets the phase between the two antennas.
    """

    delay_s: FloatArray
    amplitude: ComplexArray
    azimuth_rad: FloatArray


@dataclass(frozen=True)
class Responses:
    """Channel impulse responses of a block of frames, each (frames, taps) complex128.

    Attributes
    ----------
    preamble : array
    sts1, sts2 : array or None
        The responses of the two antennas; both or neither.
    """

    preamble: ComplexArray
    sts1: ComplexArray | None = None
    sts2: ComplexArray | None = None

    def map(self, function: Callable[[ComplexArray], ComplexArray]) -> Responses:
        """The same function of each response that is there."""
        return Responses(*(None if one is None else function(one) for one in (self.preamble, self.sts1, self.sts2)))  # type: ignore[arg-type]  # the preamble is always there


@dataclass(frozen=True)
class View:
    """One receiver in its scene, over all frames or a block of them. Arrays are shared, never changed in place.

    Attributes
    ----------
    radar : Radar
    first : int
        Index of the first frame.
    timestamp_s : (frames,) array
    receiver_m, transmitter_m : (frames, 3) array
        Positions in the world.
    boresight_rad : (frames,) array
        Heading of the receiver in the world.
    objects : tuple of SceneObject
    visibility : (frames, objects) array
        Amplitude that passes from the radar to an object and back: 1 in free sight, 0 behind something opaque.
    crest_tap : (frames,) array
        Fractional tap of the direct path's crest.
    direct_amplitude : float
        Amplitude of the direct path's crest; free space, unless a term attenuates it.
    receive_gain : callable
        Amplitude gain of the receiving antenna, for echoes, at azimuths of any shape.
    array_phase : callable
        Phase in radians of the second antenna over the first, at azimuths of any shape.
    pulse : Pulse
    anchors : tuple of SceneAnchor
    pulse_copies : tuple of (float, complex)
        Copies that follow every pulse: delay in seconds, and strength with phase against the pulse.
    """

    radar: Radar
    first: int
    timestamp_s: FloatArray
    receiver_m: FloatArray
    transmitter_m: FloatArray
    boresight_rad: FloatArray
    objects: tuple[SceneObject, ...]
    visibility: FloatArray
    crest_tap: FloatArray
    direct_amplitude: float
    receive_gain: Callable[[FloatArray], FloatArray]
    array_phase: Callable[[FloatArray], FloatArray]
    pulse: Pulse
    anchors: tuple[SceneAnchor, ...] = ()
    pulse_copies: tuple[tuple[float, complex], ...] = ()

    def __len__(self) -> int:
        return len(self.timestamp_s)

    def replace(self, **parts: Any) -> View:
        """View with some parts replaced."""
        return dataclasses.replace(self, **parts)

    def part(self, start: int, stop: int) -> View:
        """Frames ``start`` to ``stop`` of this view."""
        names = ("timestamp_s", "receiver_m", "transmitter_m", "boresight_rad", "visibility", "crest_tap")
        parts: dict[str, Any] = {name: getattr(self, name)[start:stop] for name in names}
        objects = tuple(body.part(start, stop) for body in self.objects)
        return self.replace(first=self.first + start, objects=objects, **parts)

    def azimuth_rad(self, points_m: FloatArray) -> FloatArray:
        """Azimuth (frames, n) from boresight of world points (frames or 1, n, 3)."""
        local = rotate_z(points_m - self.receiver_m[:, None], -self.boresight_rad[:, None])
        return np.arctan2(local[..., 1], local[..., 0])

    def delay_s(self, points_m: FloatArray) -> FloatArray:
        """Delay (frames, n) after the direct path of an echo from world points (frames or 1, n, 3)."""
        out = np.linalg.norm(points_m - self.transmitter_m[:, None], axis=-1)
        back = np.linalg.norm(points_m - self.receiver_m[:, None], axis=-1)
        return np.asarray((out + back - self.radar.baseline_length_m) / SPEED_OF_LIGHT_M_S)

    def echoes(self, points_m: FloatArray, amplitude: FloatArray | ComplexArray) -> Paths:
        """Paths by way of world points (frames or 1, n, 3), with the receiving antenna's gain and the carrier's phase.

        ``amplitude`` (frames or 1, n) is what an isotropic antenna would receive.
        """
        delay_s, azimuth_rad = self.delay_s(points_m), self.azimuth_rad(points_m)
        carrier = np.exp(-2j * np.pi * self.radar.center_frequency_hz * delay_s)
        return Paths(delay_s, amplitude * self.receive_gain(azimuth_rad) * carrier, azimuth_rad)


class Term(Generic[P]):
    """One part of a simulated scene: override the hooks it needs.

    Each hook runs through the terms in the order of the scene's list; of each term, one instance serves one receiver
    in one run. ``rng`` is the term's own random stream, so that terms added, dropped or moved never change what
    another one draws. The streams of ``paths`` and ``apply`` start anew at each block of frames, whose boundaries
    are fixed; what lasts longer than a frame is drawn in ``prepare``. ``paths`` and ``apply`` may run in several
    threads and must not change the instance.

    Class attributes
    ----------------
    shared : bool
        True where the draws are the same for all receivers of the robot.
    of_robot : bool
        True where the term models the robot itself: a robot's file may then give its parameters, and in a scene that
        names a robot the draws of ``prepare`` follow from the robot's seed, the receiver and the channel, so that they
        are the same in all runs and scenes. What ``paths``, ``apply`` and ``record`` draw is drawn anew in each run.
    of_place : bool
        True where the draws of ``prepare`` make the surroundings, such as what stands on the walls. A run and its
        background share them, as they share the robot; all else is drawn anew for a background.
    fidelity : str
        Where the model comes from, as of a stage.
    """

    shared: ClassVar[bool] = False
    of_robot: ClassVar[bool] = False
    of_place: ClassVar[bool] = False
    fidelity: ClassVar[Fidelity] = "baseline"

    def __init__(self, params: P) -> None:
        self.params: P = params

    @classmethod
    def params_type(cls) -> type[Params]:
        """Pydantic model of the parameters."""
        return params_type_of(cls, Term)

    def prepare(self, view: View, rng: np.random.Generator) -> View:  # noqa: ARG002
        """Start a run, given all of its frames: draw what lasts, and change gains, visibility or sampling."""
        return view

    def bound(self, view: View) -> float | None:  # noqa: ARG002
        """Upper bound of the amplitude that the paths add to any tap of any frame, before any is synthesised.

        ``fidelity: auto`` leaves the term out where this stays far enough below the noise. None, the default, means
        that the term cannot be left out.
        """
        return None

    def noise_rms(self, view: View) -> float:  # noqa: ARG002
        """Root mean square of the complex noise that this term adds to each tap of the preamble."""
        return 0.0

    def paths(self, view: View, rng: np.random.Generator) -> Paths | None:  # noqa: ARG002
        """Paths that this term adds to a block of frames."""
        return None

    def apply(self, responses: Responses, view: View, rng: np.random.Generator) -> Responses:  # noqa: ARG002
        """Change a block's responses: what a receiver does to the sum of all paths.

        Parameters
        ----------
        responses : Responses
            Sum of all paths as the terms before this one left it, arrays (frames, taps).
        view : View
            The same frames.
        rng : Generator
            The term's own stream for this block.

        Returns
        -------
        Responses
            Of the same shape.
        """
        return responses

    def record(self, capture: Capture, rng: np.random.Generator) -> Capture:  # noqa: ARG002
        """Change the finished recording as a whole: what it reports, its odometry, which frames arrive and when."""
        return capture
