"""Simulated captures are the same on every processor, up to rounding."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__

from uwbbench.config.source import open_dataset

DATASETS = {
    "approach": {"speed_m_s": 3.0},
    "limits": {"scene": "echo", "snr_db": 20, "frames": 500},
    "simulated": {"scenes": ["approach-concrete"], "set": {"trajectory.speed_m_s": 2.4}},
}
SIMPLER = {
    "NPY_DISABLE_CPU_FEATURES": " ".join(name for name in __cpu_dispatch__ if __cpu_features__[name]),
    "OPENBLAS_CORETYPE": "Prescott",
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX,-AVX2,-FMA",
}
"""An x86 processor as it was in 2004, for numpy, OpenBLAS and the C library; others ignore it."""


def write_samples(path: Path) -> None:
    """Samples of the first capture of each dataset."""
    datasets = {name: open_dataset(name, params, []) for name, params in DATASETS.items()}
    samples = {name: dataset.open(dataset.names()[0]).frames().preamble for name, dataset in datasets.items()}
    np.savez(path, **samples)


def test_a_simpler_processor_simulates_the_same_samples_to_a_millionth(tmp_path: Path) -> None:
    write_samples(tmp_path / "here.npz")
    command = [sys.executable, __file__, str(tmp_path / "there.npz")]
    subprocess.run(command, env=os.environ | SIMPLER, check=True)
    here, there = np.load(tmp_path / "here.npz"), np.load(tmp_path / "there.npz")
    for name in DATASETS:
        np.testing.assert_allclose(there[name], here[name], rtol=0, atol=1e-6 * np.abs(here[name]).max(), err_msg=name)


if __name__ == "__main__":
    write_samples(Path(sys.argv[1]))
