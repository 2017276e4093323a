"""The floor in C: compiled for this machine when the benchmark starts, called through ctypes."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np

from uwbbench.api import SPEED_OF_LIGHT_M_S, ComplexArray, Detections, Radar

SOURCE = Path(__file__).with_name("floor.c")
FLAGS = ("-O3", "-march=native", "-ffp-contract=off", "-fno-fast-math", "-std=gnu11", "-shared", "-fPIC")
MOST_TAPS = 64

_COLUMNS = ("frame", "tap", "amplitude", "prominence", "width_taps", "score_db", "delay_s", "range_m")


class _Settings(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_int32) for name in ("taps", "noise_taps", "search_taps", "guard_taps")),
        *(
            (name, ctypes.c_double)
            for name in (
                "minimum_prominence",
                "minimum_width",
                "relative_height",
                "minimum_score_db",
                "gain_db_per_ns",
                "sample_interval_s",
                "speed_m_s",
                "distance_m",
                "along_m",
            )
        ),
    )


class _Columns(ctypes.Structure):
    _fields_ = tuple((name, ctypes.c_void_p) for name in _COLUMNS)


def compiler() -> str | None:
    """The C compiler of this machine, if it has one."""
    return shutil.which("gcc") or shutil.which("cc")


class Floor:
    """`paper-filtering` without phase differences, in C.

    Parameters
    ----------
    folder : Path
        Where the library is built.

    Attributes
    ----------
    instructions : str
        What the library was compiled for.
    """

    def __init__(self, folder: Path) -> None:
        found = compiler()
        if found is None:
            raise FileNotFoundError("no C compiler")
        library = folder / "floor.so"
        subprocess.run([found, *FLAGS, str(SOURCE), "-o", str(library), "-lm"], check=True)
        self._library = ctypes.CDLL(str(library))
        self.instructions = ctypes.c_char_p.in_dll(self._library, "instructions").value.decode()

    def detector(self, radar: Radar, frames: int, entry: str = "detect_first") -> Callable[[ComplexArray], Detections]:
        """Function from samples (frames, taps) to detections; its output is overwritten by the next call."""
        if radar.taps > MOST_TAPS:
            raise ValueError(f"the floor is written for {MOST_TAPS} taps at most, not {radar.taps}")
        function = getattr(self._library, entry)
        function.restype = ctypes.c_long
        settings = _settings(radar)
        columns = {name: np.empty(frames, np.int64 if name in ("frame", "tap") else np.float64) for name in _COLUMNS}
        pointers = _Columns(*(columns[name].ctypes.data for name in _COLUMNS))

        def detect(samples: ComplexArray) -> Detections:
            if samples.dtype != np.complex64 or not samples.flags.c_contiguous or samples.shape[1] != radar.taps:
                raise ValueError("the floor reads contiguous complex64 samples")
            if len(samples) > frames:
                raise ValueError(f"room for {frames} frames, not {len(samples)}")
            data = ctypes.c_void_p(samples.ctypes.data)
            found = function(data, ctypes.c_long(len(samples)), ctypes.byref(settings), ctypes.byref(pointers))
            return Detections(processed=np.arange(len(samples)), **{name: columns[name][:found] for name in _COLUMNS})

        return detect


def _settings(radar: Radar) -> _Settings:
    """The thresholds of `paper-filtering` for the radar's channel."""
    return _Settings(
        taps=radar.taps,
        noise_taps=radar.noise_taps,
        search_taps=6,
        guard_taps=1,
        minimum_prominence={5: 0.05, 9: 0.03}[radar.channel],
        minimum_width={5: 1.0, 9: 0.20}[radar.channel],
        relative_height=0.5,
        minimum_score_db={5: 20.0, 9: 10.0}[radar.channel],
        gain_db_per_ns=0.20,
        sample_interval_s=radar.sample_interval_s,
        speed_m_s=SPEED_OF_LIGHT_M_S,
        distance_m=radar.baseline_length_m,
        along_m=radar.baseline_m[0],
    )
