"""Adding up a scene: all frames of a block at once, each pulse only on the taps that it reaches."""

from __future__ import annotations

import time
import zlib
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any, Literal, NamedTuple

import numpy as np

from uwbbench.api import (
    SPEED_OF_LIGHT_M_S,
    Capture,
    CaptureError,
    ComplexArray,
    FloatArray,
    Paths,
    Radar,
    Responses,
    SceneAnchor,
    SceneObject,
    Term,
    Trajectory,
    Truth,
    View,
    receiver_pose,
    simulated_recording,
)
from uwbbench_datasets.simulator.anchors import anchors_of
from uwbbench_datasets.simulator.fidelity import Contribution, choose, described
from uwbbench_datasets.simulator.scene import Scene
from uwbbench_datasets.simulator.shapes import ObjectModel
from uwbbench_datasets.simulator.trajectory import sampled

BLOCK = 1024
"""Frames synthesised at once. Random streams start anew at each block, so that changing it changes all draws."""

_NO_RUN = 0
"""In the place of a run's number, which counts from 1, in the streams of what belongs to the robot."""

_BACKGROUND = zlib.crc32(b"background")
"""Before the number of the run in the streams of its background, whose noise, grid and gain are others."""

_HEIGHTS = 2**18
"""Values of pulses and sums held at a time, which bounds the memory."""


class _Stream(NamedTuple):
    """What the random streams of a term follow from."""

    seed: int
    key: tuple[int, ...]


@dataclass
class _Part:
    """A term at work on one receiver."""

    name: str
    term: Term[Any]
    of_run: _Stream
    of_prepare: _Stream  # the robot's or the place's, where what is drawn once belongs to it
    seconds: float = 0.0
    pulses: int = 0

    def has(self, hook: str) -> bool:
        """Whether the term does anything in a hook."""
        return getattr(type(self.term), hook) is not getattr(Term, hook)

    def rng(self, hook: Literal["prepare", "paths", "apply", "record"], block: int = 0) -> np.random.Generator:
        """Random stream of one hook, in one block if it works on blocks."""
        seed, owner = self.of_prepare if hook == "prepare" else self.of_run
        key = (*owner, zlib.crc32(hook.encode()), block)
        return np.random.Generator(np.random.SFC64(np.random.SeedSequence(seed, spawn_key=key)))


@dataclass(frozen=True)
class Simulation:
    """Finished captures of one run, one for each receiver, and what became of each term.

    Attributes
    ----------
    captures : tuple of Capture
    contributions : dict
        Of each receiver, one :class:`Contribution` a term.
    """

    captures: tuple[Capture, ...]
    contributions: dict[str, tuple[Contribution, ...]] = field(default_factory=dict)

    def record(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return {
            "captures": [capture.name for capture in self.captures],
            "receivers": {name: [one.to_dict() for one in of_terms] for name, of_terms in self.contributions.items()},
        }


def simulate(scene: Scene, run: int = 1, *, background: bool = False, threads: int = 1) -> Simulation:
    """Simulate one run of a scene.

    Parameters
    ----------
    scene : Scene
    run : int
        Number of the run, from 1; each has its own draws.
    background : bool
        Give each capture a background: the same run of the same robot at the same place, with walls and other structure
        and without the objects, and with noise, grid and gain of its own.
    threads : int
        Blocks worked on at a time. The result does not depend on it.

    Raises
    ------
    CaptureError
        If the trajectory's file cannot be used, or a term gives paths that are not finite.
    """
    scene = scene.of_run(run)
    trajectory = sampled(scene.model.trajectory, scene.model.radar.frame_rate_hz, scene.folder)
    objects = tuple(item.moving(trajectory.timestamp_s, _motion(scene, run, item)) for item in scene.model.objects)
    anchors = anchors_of(scene.model.anchors, trajectory, scene.model.seed, (run, zlib.crc32(b"anchor")))
    captures, contributions = [], {}
    for receiver in scene.model.receivers:
        capture, of_terms = _one_receiver(scene, run, receiver, trajectory, objects, anchors, threads)
        if anchors and capture.anchors is None:
            raise CaptureError(f"scene '{scene.name}' has anchors, but no term that hears them: add anchor.messages")
        anchors = tuple(replace(anchor, offset_m=None) for anchor in anchors)  # the first receiver has reported it
        if background:
            structure = tuple(body for body in objects if body.structure)
            empty, _ = _one_receiver(scene, run, receiver, trajectory, structure, (), threads, background=True)
            said = f"Simulated by uwbbench. {capture.name} without its objects, with noise of its own."
            named = replace(empty, name=f"{empty.name} background", description=said, anchors=None)
            capture = replace(capture, background=named)
        captures.append(capture)
        contributions[receiver] = of_terms
    text = _described(scene, contributions)
    return Simulation(tuple(replace(capture, description=text) for capture in captures), contributions)


def _motion(scene: Scene, run: int, item: ObjectModel) -> np.random.Generator:
    """Random stream of one object's motion in a run, the same for all receivers."""
    key = (run, zlib.crc32(b"motion"), zlib.crc32(item.id.encode()))
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence(scene.model.seed, spawn_key=key)))


def _one_receiver(
    scene: Scene,
    run: int,
    receiver: str,
    trajectory: Trajectory,
    objects: tuple[SceneObject, ...],
    anchors: tuple[SceneAnchor, ...],
    threads: int,
    *,
    background: bool = False,
) -> tuple[Capture, tuple[Contribution, ...]]:
    parts = [_part(scene, run, receiver, index, background=background) for index in range(len(scene.terms))]
    view = _view(scene, scene.radar(receiver), trajectory, objects).replace(anchors=anchors)
    for part in [part for part in parts if part.has("prepare")]:
        started = time.perf_counter()
        view = part.term.prepare(view, part.rng("prepare"))
        part.seconds += time.perf_counter() - started
    chosen = choose([(part.name, part.term) for part in parts], view, scene.model.fidelity)
    kept = [part for part, one in zip(parts, chosen, strict=True) if one.kept]
    responses = _stored(_synthesised(kept, view, threads), view.radar)
    several = len(scene.model.receivers) > 1
    contributions = tuple(
        replace(one, seconds=part.seconds, pulses=part.pulses) for part, one in zip(parts, chosen, strict=True)
    )
    capture = Capture(
        name="/".join([scene.name, str(run), *([receiver] if several else [])]),
        radar=view.radar,
        trajectory=trajectory,
        truth=Truth(tuple(body.obstacle for body in objects)),
        source="simulated",
        license="BSD-3-Clause",
        citation="Simulated by uwbbench.",
        recording=simulated_recording(f"{scene.name}/{run}", f"scene seed {scene.model.seed}, run {run}"),
        robot=scene.robot_identity,
        preamble=responses.preamble,
        sts1=responses.sts1,
        sts2=responses.sts2,
        receivers=tuple(scene.model.receivers),
    )
    for part in [part for part in kept if part.has("record")]:
        capture = part.term.record(capture, part.rng("record"))
    return capture, contributions


def _part(scene: Scene, run: int, receiver: str, index: int, *, background: bool) -> _Part:
    use, term, params = scene.terms[index]
    owner = "" if term.shared else receiver
    key = (zlib.crc32(owner.encode()), zlib.crc32(use.name.encode()))
    of_run = of_prepare = _Stream(scene.model.seed, (run, *key))
    if background:
        of_run = _Stream(scene.model.seed, (_BACKGROUND, run, *key))
        of_prepare = of_prepare if term.of_robot or term.of_place else of_run
    if term.of_robot and scene.robot_seed is not None:
        of_prepare = _Stream(scene.robot_seed, (_NO_RUN, scene.model.radar.channel, *key))
    return _Part(use.name, term(params), of_run, of_prepare)


def _view(scene: Scene, radar: Radar, trajectory: Trajectory, objects: tuple[SceneObject, ...]) -> View:
    """The scene before any term has changed it: free sight, isotropic antennas, a grid locked to the direct path."""
    frames = len(trajectory)
    receiver_m, boresight_rad = receiver_pose(
        trajectory.position_m, trajectory.yaw_rad, np.asarray(radar.mount_position_m), radar.mount_yaw_rad
    )
    transmitter_m, _ = receiver_pose(trajectory.position_m, trajectory.yaw_rad, np.asarray(radar.tx_position_m), 0.0)
    gain = 10 ** (scene.model.radar.gain_dbi / 20)
    slope = 2 * np.pi * scene.model.radar.array_spacing_mm * 1e-3 / radar.wavelength_m
    return View(
        radar=radar,
        first=0,
        timestamp_s=trajectory.timestamp_s,
        receiver_m=receiver_m,
        transmitter_m=transmitter_m,
        boresight_rad=boresight_rad,
        objects=objects,
        visibility=np.ones((frames, len(objects))),
        crest_tap=np.full(frames, _crest_tap(scene, radar)),
        direct_amplitude=radar.wavelength_m / (4 * np.pi * radar.baseline_length_m),
        receive_gain=lambda azimuth_rad: np.full(np.shape(azimuth_rad), gain),
        array_phase=lambda azimuth_rad: slope * np.sin(azimuth_rad),
        pulse=scene.model.radar.shape(),
    )


def _crest_tap(scene: Scene, radar: Radar) -> float:
    """Tap of the direct path's crest, which lies before the first where a device starts to listen later."""
    if radar.first_tap_delay_s is None:
        return scene.model.radar.crest_tap
    return (radar.baseline_length_m / SPEED_OF_LIGHT_M_S - radar.first_tap_delay_s) / radar.sample_interval_s


def _stored(responses: Responses, radar: Radar) -> Responses:
    """Responses as the device stores them: real RF is the real part at the carrier."""
    if radar.samples == "iq":
        return responses
    carrier = np.exp(2j * np.pi * radar.center_frequency_hz * radar.sample_interval_s * np.arange(radar.taps))
    preamble: Any = (responses.preamble * carrier).real.astype(np.float32)
    return Responses(preamble)


def _described(scene: Scene, contributions: Mapping[str, Sequence[Contribution]]) -> str:
    """Description for the captures' file: how they were made."""
    about = scene.model.description or scene.name
    if scene.robot_identity:
        about += f" Robot {scene.robot_identity}."
    parts = [f"{receiver}: {described(of_terms)}" for receiver, of_terms in contributions.items()]
    return " | ".join([f"Simulated by uwbbench. {about}", *parts])


def _synthesised(parts: list[_Part], view: View, threads: int) -> Responses:
    """Responses of all frames, complex64 as a device would store them."""
    shape = (len(view), view.radar.taps)
    out = [np.empty(shape, np.complex64) for _ in range(3 if view.radar.has_sts else 1)]

    def work(block: int) -> list[tuple[float, int]]:
        rows = slice(block * BLOCK, min((block + 1) * BLOCK, len(view)))
        responses, costs = _block(parts, view.part(rows.start, rows.stop), block)
        computed = (responses.preamble, responses.sts1, responses.sts2)
        for target, values in zip(out, computed, strict=False):
            target[rows] = values
        return costs

    np.empty(2**24, np.uint8)  # its release makes glibc keep such blocks: page faults would cost half of the time
    blocks = range(-(-len(view) // BLOCK))
    with ThreadPoolExecutor(threads) as pool:
        for costs in pool.map(work, blocks) if threads > 1 else map(work, blocks):
            for part, (seconds, pulses) in zip(parts, costs, strict=True):
                part.seconds += seconds
                part.pulses += pulses
    return Responses(*out)


def _block(parts: list[_Part], view: View, block: int) -> tuple[Responses, list[tuple[float, int]]]:
    """Responses of one block, and the seconds and pulses of each term."""
    shape = (len(view), view.radar.taps)
    antennas = np.zeros((2 if view.radar.has_sts else 1, *shape), complex)
    costs = []
    for part in parts:
        started, pulses = time.perf_counter(), 0
        paths = part.term.paths(view, part.rng("paths", block)) if part.has("paths") else None
        if paths is not None:
            add_paths(antennas, paths, view, part.name)
            pulses = paths.delay_s.shape[1] * len(view)
        costs.append((time.perf_counter() - started, pulses))
    sts = (antennas[0].copy(), antennas[1]) if len(antennas) == 2 else (None, None)
    responses = Responses(antennas[0], *sts)
    for index, part in enumerate(parts):
        if part.has("apply"):
            started = time.perf_counter()
            responses = part.term.apply(responses, view, part.rng("apply", block))
            seconds, pulses = costs[index]
            costs[index] = (seconds + time.perf_counter() - started, pulses)
    return responses, costs


def add_paths(antennas: ComplexArray, paths: Paths, view: View, name: str = "paths") -> None:
    """Add the pulses of paths to the responses (1 or 2, frames, taps) of the antennas, in place.

    Parameters
    ----------
    antennas : (1 or 2, frames, taps) complex array
        Responses so far; the second antenna is that of the array. Written.
    paths : Paths
        Delays count from the crest of each frame's direct path.
    view : View
        The same frames; gives the crest's tap, the pulse, the sample interval and the phase between the antennas.
    name : str
        Name of the term that gives the paths, for messages.

    Raises
    ------
    CaptureError
        If a delay or amplitude is not finite.
    """
    if view.pulse_copies:
        paths = _with_copies(paths, view)
    shape = (len(view), np.shape(paths.delay_s)[1])
    if not shape[1]:
        return
    strengths = [np.broadcast_to(paths.amplitude, shape)]
    if len(antennas) == 2:
        strengths.append(paths.amplitude * np.exp(1j * view.array_phase(paths.azimuth_rad)) + np.zeros(shape))
    strength = np.asarray(np.stack([part for one in strengths for part in (one.real, one.imag)], axis=1), float)
    if not (np.all(np.isfinite(paths.delay_s)) and np.all(np.isfinite(strength))):
        raise CaptureError(f"term '{name}' gives a path whose delay or amplitude is not finite")
    tap = np.asarray(view.crest_tap[:, None] + paths.delay_s / view.radar.sample_interval_s, float)
    reach = view.pulse.support_s / view.radar.sample_interval_s
    taps = antennas.shape[2]
    step = max(1, _HEIGHTS // max(shape[1] * int(min(taps, 2 * reach + 1)), 8 * taps))
    for start in range(0, shape[0], step):
        rows = slice(start, start + step)
        if 2 * reach + 1 >= taps:  # the pulse is on all taps, wherever its crest is
            offset = np.arange(taps) - tap[rows, :, None]
            added = (strength[rows] @ view.pulse(offset * view.radar.sample_interval_s)).swapaxes(0, 1)
        else:
            added = _scattered(strength[rows], tap[rows], reach, taps, view)
        antennas.real[:, rows] += added[0::2]
        antennas.imag[:, rows] += added[1::2]


def _with_copies(paths: Paths, view: View) -> Paths:
    """Paths with the copies that follow each pulse."""
    copies = [(0.0, 1.0 + 0j), *view.pulse_copies]
    return Paths(
        np.concatenate([paths.delay_s + delay_s for delay_s, _ in copies], axis=1),
        np.concatenate([paths.amplitude * strength for _, strength in copies], axis=1),
        np.concatenate([paths.azimuth_rad] * len(copies), axis=1),
    )


def _scattered(strength: FloatArray, tap: FloatArray, reach: float, taps: int, view: View) -> FloatArray:
    """Sum of pulses (parts, frames, taps), each evaluated only on the taps that it reaches.

    Paths that lie close together share one window of taps, in which they are summed by a matrix product; paths far
    apart have a window each. Windows lie in a frame with room on either side, so that none needs to be cut.

    Parameters
    ----------
    strength : (frames, parts, paths) array
    tap : (frames, paths) array
        Where the crests lie.
    reach : float
        Taps on either side of a crest.
    taps : int
        Taps of a frame.
    view : View
    """
    frames, parts, count = strength.shape
    width = int(2 * reach) + 1
    first = np.clip(np.ceil(tap - reach), -width, taps)
    spread = int(np.max(np.ptp(first, axis=1)))
    together = spread <= width
    window = width + spread if together else width
    groups = (1, count) if together else (count, 1)
    start = first.reshape(frames, *groups).min(axis=2)
    interval = view.radar.sample_interval_s
    offset_s = (start[..., None] - tap.reshape(frames, *groups)) * interval
    height = view.pulse(offset_s[..., None] + np.arange(window) * interval)
    sums = strength.reshape(frames, parts, *groups).swapaxes(1, 2) @ height
    room = taps + width + window
    place = (np.arange(frames) * room)[:, None, None] + (start.astype(np.int64) + width)[..., None] + np.arange(window)
    flat = place.ravel()
    padded = np.empty((parts, frames, room))
    for part in range(parts):
        padded[part] = np.bincount(flat, sums[:, :, part].ravel(), frames * room).reshape(frames, room)
    return padded[:, :, width : width + taps]
