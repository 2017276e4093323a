"""How much faster the simulator is than a loop over frames and scatterers, and what leaving terms out saves.

Run ``python tests/bench/bench_simulator.py``. Rounds alternate between the two programs, so that a busy machine slows
both; the ratio of the medians counts, not the times. The loop adds the same terms one path at a time, as one would
first write it; its frames must agree with the simulator's, which is checked before anything is timed.
"""

import math
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.special import fresnel

from uwbbench.api.geometry import SPEED_OF_LIGHT_M_S
from uwbbench_datasets.simulator.engine import simulate
from uwbbench_datasets.simulator.materials import reflection
from uwbbench_datasets.simulator.scene import Scene, read_scenes

SCENE = Path(__file__).parents[2] / "configs" / "scenes" / "plate.yaml"
FEW, MANY = 500, 8000
ROUNDS = 7
NODES, WEIGHTS = np.polynomial.legendre.leggauss(7)


def scene_of(frames: int, **changes: object) -> Scene:
    """The shipped scene over so many frames."""
    speed = 2.8 / (frames - 0.5) * 48
    return read_scenes(SCENE, {"trajectory.speed_m_s": speed, **changes})[0]


def plate_amplitude(point: np.ndarray, transmitter: np.ndarray, receiver: np.ndarray, wavelength: float) -> float:
    """Fresnel plate of 25 x 28 cm, centred at y = 0.1, averaged over 10 % of the range."""
    out, back = np.linalg.norm(point - transmitter), np.linalg.norm(point - receiver)
    r = 2 * out * back / (out + back)
    depth = point[0]
    share = (depth - receiver[0]) / ((depth - receiver[0]) + (depth - transmitter[0]))
    meeting = receiver + share * (transmitter - receiver)
    power = 0.0
    for node, weight in zip(NODES, WEIGHTS, strict=True):
        near = r * (1 + 0.1 * node)
        product = 1.0
        for low, high in ((-0.125 + 0.1 - meeting[1], 0.125 + 0.1 - meeting[1]), (-0.14, 0.14)):
            s1, c1 = fresnel(2 * low / math.sqrt(wavelength * near))
            s2, c2 = fresnel(2 * high / math.sqrt(wavelength * near))
            product *= math.sqrt(2) * math.hypot(s2 - s1, c2 - c1) / 2
        power += weight / 2 * (wavelength / (8 * math.pi * near) * product) ** 2
    facing = math.sqrt((depth - receiver[0]) * (depth - transmitter[0])) / r
    smooth = wavelength / (8 * math.pi * r) * 2
    for half in (0.125, 0.14):
        smooth *= min(0.95, 2 * half / math.sqrt(wavelength * r))
    return max(math.sqrt(power), 10 ** (-15 / 20) * facing * smooth)


def looped(scene: Scene, *, noisy: bool = True) -> np.ndarray:
    """Responses (3, frames, taps) of the shipped scene, frame by frame and path by path."""
    rng = np.random.default_rng(1)
    radar = scene.radar("front")
    wavelength, interval = radar.wavelength_m, radar.sample_interval_s
    speed = scene.model.trajectory.speed_m_s  # type: ignore[union-attr]
    frames = int(2.8 / speed * 48 * (1 + 1e-12)) + 1
    direct = wavelength / (4 * math.pi * 0.25) * 10 ** (-6 / 20)
    noise = direct * 10 ** (-45 / 20)
    ringing_s = 1e-9 + 0.5e-9 * np.arange(12)
    strength = (rng.normal(size=12) + 1j * rng.normal(size=12)) / math.sqrt(2)
    ringing = direct * np.sqrt(10**-0.9 * np.exp(-ringing_s / 1.5e-9)) * strength
    slope = 2 * math.pi * 17.8e-3 / wavelength
    material = reflection("metal", radar.center_frequency_hz)
    taps = np.arange(radar.taps)
    out = np.zeros((3, frames, radar.taps), complex)
    for frame in range(frames):
        crest = 7.0 + (rng.uniform(-0.5, 0.5) if noisy else 0.0)
        x = min(frame / 48 * speed, 2.8)
        receiver, transmitter = np.array([x, 0.0, 0.0]), np.array([x, -0.25, 0.0])
        point = np.array([3.399, max(-0.125, -0.025), 0.0])  # the mirror point lies at the plate's near edge
        delay = (np.linalg.norm(point - transmitter) + np.linalg.norm(point - receiver) - 0.25) / SPEED_OF_LIGHT_M_S
        azimuth = math.atan2(point[1], point[0] - x)
        echo = 10 ** (6 / 20) * plate_amplitude(point, transmitter, receiver, wavelength)
        paths = [(0.0, direct + 0j, -math.pi / 2)]
        turns = rng.uniform(0, 2 * math.pi, 12)
        for index in range(12):
            drift = 1 + (0.015 * math.sin(2 * math.pi * frame / 48 / 60 + turns[index]) if noisy else 0.0)
            paths.append((ringing_s[index], ringing[index] * drift, 0.0))
        carrier = np.exp(-2j * math.pi * radar.center_frequency_hz * delay)
        paths.append((delay, material * echo * carrier, azimuth))
        factor = 10 ** (rng.normal(0, 0.5) / 20) * np.exp(2j * math.pi * rng.uniform()) if noisy else 1.0
        sums = np.zeros((2, radar.taps), complex)
        for path_s, amplitude, arrival in paths:
            time_s = (taps - crest) * interval - path_s
            pulse = amplitude * np.exp(-4 * math.log(2) * (time_s / 3.2e-9) ** 2)
            sums[0] += pulse
            sums[1] += np.exp(1j * slope * math.sin(arrival)) * pulse
        for antenna, response, loss_db in ((0, 0, 0.0), (0, 1, 4.0), (1, 2, 4.0)):
            total = sums[antenna] * factor
            if noisy:
                white = rng.normal(size=radar.taps) + 1j * rng.normal(size=radar.taps)
                total += noise * 10 ** (loss_db / 20) / math.sqrt(2) * white
            out[response, frame] = total
    return out.astype(np.complex64)


def seconds(function: Callable[[], object]) -> float:
    """Processor time of one call, which other programs on the machine hardly change."""
    started = time.process_time()
    function()
    return time.process_time() - started


def check_agreement() -> float:
    """Largest difference between loop and simulator, without what is random, relative to the direct path."""
    quiet = {"terms": [{"use": "direct"}, {"use": "echo.plate"}], "radar.channel": 9}
    found = simulate(scene_of(60, **quiet)).captures[0]
    whole, ringing_only = looped(scene_of(60), noisy=False), looped_ringing(scene_of(60))
    given = np.stack([found.preamble[:], found.sts1[:], found.sts2[:]])  # type: ignore[index]
    return float(np.max(np.abs(whole - ringing_only - given)) / np.max(np.abs(given)))


def looped_ringing(scene: Scene) -> np.ndarray:
    """The loop's ringing alone, as its draws are not the simulator's."""
    rng = np.random.default_rng(1)
    radar = scene.radar("front")
    direct = radar.wavelength_m / (4 * math.pi * 0.25) * 10 ** (-6 / 20)
    delays = 1e-9 + 0.5e-9 * np.arange(12)
    strength = (rng.normal(size=12) + 1j * rng.normal(size=12)) / math.sqrt(2)
    ringing = direct * np.sqrt(10**-0.9 * np.exp(-delays / 1.5e-9)) * strength
    time_s = (np.arange(radar.taps)[:, None] - 7.0) * radar.sample_interval_s - delays
    return np.exp(-4 * math.log(2) * (time_s / 3.2e-9) ** 2) @ ringing


def main() -> None:
    """Print the figures."""
    print(f"largest difference from the loop: {check_agreement():.1e} of the direct path")
    few, many = scene_of(FEW), scene_of(MANY)
    far = {"objects.0.center_m": [900.0, 0.0]}  # an echo that lies far below the noise
    dropped, forced = scene_of(MANY, **far), scene_of(MANY, **far, **{"fidelity.force": ["echo.plate"]})
    programs: dict[str, Callable[[], object]] = {
        "loop": lambda: looped(few),
        "few": lambda: simulate(few),
        "many": lambda: simulate(many),
        "dropped": lambda: simulate(dropped),
        "forced": lambda: simulate(forced),
    }
    times: dict[str, list[float]] = {name: [] for name in programs}
    for _ in range(ROUNDS):
        for name, program in programs.items():
            times[name].append(seconds(program))
    median = {name: statistics.median(values) for name, values in times.items()}
    per_frame = {"loop": median["loop"] / FEW, "few": median["few"] / FEW, "many": median["many"] / MANY}
    print(f"loop:      {per_frame['loop'] * 1e6:8.1f} us a frame")
    both = f"over {MANY} frames, {per_frame['few'] * 1e6:.1f} over {FEW}"
    print(f"simulator: {per_frame['many'] * 1e6:8.1f} us a frame {both}")
    print(f"ratio:     {per_frame['loop'] / per_frame['many']:8.1f}")
    saved = 1 - median["dropped"] / median["forced"]
    print(f"one echo below the margin left out: {saved:.0%} of the time saved")


if __name__ == "__main__":
    main()
