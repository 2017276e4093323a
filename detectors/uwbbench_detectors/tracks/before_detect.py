"""Moving bodies found by their way through many frames, not by one."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from pydantic import Field

from uwbbench.api import SPEED_OF_LIGHT_M_S, Block, Detections, Params, Radar, Stage, ports

FRESH_RATE = 0.01
"""Share of frames of noise alone in which some path is fresh, at most."""


class TrackBeforeDetectParams(Params):
    """How bodies move, how deep they are, and how often noise may look like one."""

    speed_m_s: float = Field(
        2.0, gt=0, le=100, description="Largest speed towards or away from the radar; 2 m/s is a person in a hurry."
    )
    acceleration_m_s2: float = Field(
        0.5,
        gt=0,
        le=1000,
        description="Usual acceleration. A path forgets in the time in which it moves a body by its own depth, "
        "sqrt(2 depth / acceleration): 1.3 s for a person.",
    )
    depth_m: float = Field(
        0.45,
        gt=0,
        le=20,
        description="Depth of a body: echoes nearer to each other than this are one body. 0.45 m holds a person's "
        "trunk and arms.",
    )
    false_alarm_rate: float = Field(
        1.0e-6,
        gt=0,
        le=0.1,
        description="Share of frames of noise alone with a detection, at most. In noise that is Gaussian and new in "
        "each frame; a bound, which noise keeps with a wide margin.",
    )
    lowest_db: float = Field(
        -3.0,
        lt=0,
        ge=-60,
        description="Evidence of a tap in which nothing is: 10 log10 of how often a body that is there fades into the "
        "noise, half of the frames.",
    )
    highest_db: float = Field(
        18.0,
        gt=0,
        le=60,
        description="Most evidence of one tap in one frame. A path must have gathered more than this, so that no "
        "single frame, however disturbed, is a detection.",
    )
    fresh_s: float = Field(
        0.25,
        gt=0,
        description="Time in which fresh evidence is forgotten. While a body fades its path lives on, and noise near "
        "it must not be taken for it: a detection needs evidence of this time that noise alone has in one frame of "
        "100.",
    )
    start_s: float = Field(
        2.0,
        ge=0,
        description="What a tap shows on average in this time from the first frame on is where its level starts: a "
        "radar that warms up, a background that is not yet learnt.",
    )
    level_s: float = Field(
        60.0,
        gt=0,
        description="Time over which what a tap shows becomes what it always shows, and is no evidence any more: the "
        "jitter of a strong reflector, a fan. Long against the time for which a body may walk round the radar, at one "
        "range.",
    )
    guard_taps: float = Field(
        3.0,
        ge=0,
        description="Taps behind the first path that are not looked at: what its main lobe leaves moves with gain "
        "and phase.",
    )
    targets: int = Field(1, ge=1, le=16, description="Bodies looked for in each frame, strongest path first.")


class TrackBeforeDetect(Stage[TrackBeforeDetectParams]):
    """Taps where the best paths through the frames so far end (track before detect, by dynamic programming).

    The evidence of a tap in a frame is its power over the noise in dB, less an offset, clipped at both ends, and less
    what this tap has shown on average over ``level_s``, above the lowest:

        ``l = clip(20 log10(|x| / noise) - neutral, lowest, highest) - level``.

    What a path has gathered that ends in tap j of frame k is

        ``V_k(j) = max(0, exp(-T / tau) max V_(k-1)(i) + l_k(j))``, the maximum over ``|i - j| <= v T / tap``,

    with the true time T between frames, the largest speed v, and ``tau = sqrt(2 depth / acceleration)``. A body that
    fades for some frames stays on its path; what flickers without going on in time gathers little, and a strong echo
    counts for no more than a clear one. The tap with the largest V is the detection of a frame if V exceeds the
    threshold and there is fresh evidence for it, of ``fresh_s`` and of that very frame: a body that stands as still as
    the room gives none, and its path is forgotten. ``score_db`` is V.

    ``neutral`` and the threshold follow from the false-alarm rate, the reach of a step and the taps, as
    :mod:`uwbbench_detectors.tracks.noise_paths` derives; ``highest_db`` is added to the threshold. Logarithms make
    evidence robust, as in a log-CFAR: interference with a heavy tail gains less by them than under the likelihood ratio
    of Gaussian noise, which is linear in power.

    With several ``targets`` the evidence within a depth of a detection is taken away, and the paths of the next one are
    followed in what is left. Which is which is not kept, and echoes by way of walls are bodies like any other.

    Frames that are invalid, of zeros or without noise are passed over, and bodies may go on meanwhile. For a radar that
    stands: before a moving one everything moves.

    References
    ----------
    Y. Barniv, "Dynamic programming solution for detecting dim moving targets", IEEE Trans. AES 21(1), 1985.
    R. Nitzberg, "Clutter map CFAR analysis", IEEE Trans. AES 22(4), 1986 (level of each tap;
    here a mean of logarithms).
    """

    consumes: ClassVar[frozenset[str]] = ports("frames", "noise", "first_path")
    produces: ClassVar[frozenset[str]] = ports("detections", "tap", "amplitude", "score_db")

    def open(self, radar: Radar) -> None:
        """Derive offset and threshold, and start without paths."""
        super().open(radar)
        from uwbbench_detectors.tracks import before_detect_loops as loops
        from uwbbench_detectors.tracks.noise_paths import neutral_db, threshold_db

        p = self.params
        tap_m = radar.sample_interval_s * SPEED_OF_LIGHT_M_S / 2
        clips = (p.lowest_db, p.highest_db)
        cells = 2 * math.ceil(min(p.speed_m_s / tap_m / radar.frame_rate_hz, radar.taps)) + 1
        neutral = neutral_db(cells, *clips)
        settings = {
            loops.TAPS_A_SECOND: p.speed_m_s / tap_m,
            loops.MEMORY_S: math.sqrt(2 * p.depth_m / p.acceleration_m_s2),
            loops.FRESH_S: p.fresh_s,
            loops.START_S: p.start_s,
            loops.LEVEL_S: p.level_s,
            loops.NEUTRAL_DB: neutral,
            loops.LOWEST_DB: p.lowest_db,
            loops.HIGHEST_DB: p.highest_db,
            loops.THRESHOLD_DB: p.highest_db + threshold_db(cells, radar.taps, p.false_alarm_rate, neutral, clips),
            loops.FRESH_DB: threshold_db(cells, radar.taps, FRESH_RATE, neutral, clips),
            loops.DEPTH_TAPS: math.ceil(min(p.depth_m / tap_m, radar.taps)),
            loops.GUARD_TAPS: p.guard_taps,
        }
        self._follow = loops.follow
        self._settings = np.zeros(loops.SETTINGS)
        self._settings[list(settings)] = list(settings.values())
        self._gathered = np.zeros((p.targets, radar.taps))
        self._fresh = np.zeros((p.targets, radar.taps))
        self._level = np.zeros(radar.taps)
        self._carried = np.zeros(loops.CARRIED)
        self._carried[loops.TIME_S] = np.nan

    def step(self, block: Block) -> Block:
        """Block with the ends of the best paths, by frame."""
        frames = block.frames
        noise = block.part("noise_rms")
        usable = frames.valid & (noise > 0) & (noise < np.inf)
        row, tap, score_db = self._follow(
            frames.amplitude,
            noise,
            block.part("first_path"),
            frames.timestamp_s,
            usable,
            self._gathered,
            self._fresh,
            self._level,
            self._carried,
            self._settings,
        )
        detections = Detections(
            frames.first + row,
            processed=frames.index,
            tap=tap,
            amplitude=frames.amplitude[row, tap],
            score_db=score_db,
        )
        return block.replace(detections=detections)
