"""What single objects add to their echo where a scene says so: fading, a tail, and a wrong direction."""

from __future__ import annotations

import numpy as np

from uwbbench.api import ComplexArray, EchoFading, EchoTail, FloatArray, SceneObject, View
from uwbbench_datasets.simulator.speckle import LARGEST, drawn_for, speckle, swing


def fading(body: SceneObject, model: EchoFading, view: View, *, bound: bool = False) -> FloatArray:
    """Factor (frames,) of an object's own echo: its level swings normally about what it would be.

    Parameters
    ----------
    body : SceneObject
    model : EchoFading
    view : View
    bound : bool
        Give the largest factor that any place may have instead.
    """
    if bound:
        level_db = np.full(len(view), np.sqrt(2) * LARGEST * model.sd_db)
    else:
        level_db = model.sd_db * swing(body, view, "fading", model.length_m, model.seed)
    return np.asarray(10 ** (level_db / 20))


def tail(
    body: SceneObject,
    model: EchoTail,
    points_m: FloatArray,
    amplitude: FloatArray | ComplexArray,
    view: View,
    *,
    bound: bool = False,
) -> tuple[FloatArray, ComplexArray]:
    """Returns from behind the strongest echo of an object, on the line of sight.

    Parameters
    ----------
    body : SceneObject
    model : EchoTail
    points_m : (frames, n, 3) array
        Where the echoes of the object come from.
    amplitude : (frames, n) array
        What isotropic antennas exchange by them.
    view : View
    bound : bool
        Give amplitudes that none exceeds instead.

    Returns
    -------
    (frames, returns, 3) array
    (frames, returns) array
    """
    frame, strongest = np.arange(len(view)), np.argmax(np.abs(amplitude), axis=1)
    face_m, level = points_m[frame, strongest], amplitude[frame, strongest]
    sight = face_m - view.receiver_m
    sight = sight / np.maximum(np.linalg.norm(sight, axis=1, keepdims=True), 1e-9)
    depth_m = np.linspace(model.from_m, model.to_m, model.returns)
    power = np.exp(-depth_m / model.decay_m)
    share = np.sqrt(10 ** (model.level_db / 10) * power / power.sum())
    if bound:
        turned = np.full((len(view), model.returns), 1.0 if model.length_m is None else LARGEST, complex)
    elif model.length_m is None:
        phase = drawn_for(body, view, "tail", model.seed).uniform(0, 2 * np.pi, model.returns)
        turned = np.exp(1j * phase)[None]
    else:
        each = range(model.returns)
        turned = np.stack([speckle(body, view, f"tail {n}", model.length_m, model.seed) for n in each], axis=1)
    return face_m[:, None] + sight[:, None] * depth_m[:, None], level[:, None] * share * turned


def bearing_error_rad(body: SceneObject, view: View) -> FloatArray:
    """Error (frames,) of the direction that an object's echoes seem to come from: bias and glint."""
    error = np.full(len(view), body.bearing_bias_rad)
    if body.bearing_sd_rad:
        error += body.bearing_sd_rad * swing(body, view, "bearing", body.bearing_length_m)
    return error
