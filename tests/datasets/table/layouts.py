"""Recordings in five formats and many layouts, and the mappings that read them."""

import json
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import scipy.io
import yaml

from uwbbench.config.source import open_dataset

FRAMES = 24


def mapping_of(capture, samples, **changes):
    """Mapping of a recording of the simulated approach; ``samples`` gives the layout of each response."""
    outline = capture.truth.objects[0].outline_m.tolist()
    return {
        "schema": 1,
        "origin": "simulated",
        "radar": {
            "model": capture.radar.model,
            "channel": 9,
            "bandwidth_hz": capture.radar.bandwidth_hz,
            "sample_interval_s": capture.radar.sample_interval_s,
            "frame_rate_hz": capture.radar.frame_rate_hz,
        },
        "receivers": {
            "front": {
                "mount_position_m": [0, 0, 0],
                "mount_yaw_deg": 0,
                "tx_position_m": list(capture.radar.tx_position_m),
                "noise_taps": capture.radar.noise_taps,
                "array_spacing_m": capture.radar.array_spacing_m,
            }
        },
        "preamble": samples("preamble"),
        "sts1": samples("sts1"),
        "sts2": samples("sts2"),
        "time": {"column": "t", "unit": "s"},
        "first_path": {"preamble": "fp", "sts1": "fp", "sts2": "fp"},
        "pose": {"x": "x", "y": "y", "z": "z", "yaw": "yaw", "length_unit": "m", "angle_unit": "rad"},
        "truth": {"exhaustive": True, "objects": [{"id": "plate", "material": "metal", "outline_m": outline}]},
        **changes,
    }


def scalars(capture):
    track = capture.trajectory
    x, y, z = track.position_m.T
    return {"t": track.timestamp_s, "x": x, "y": y, "z": z, "yaw": track.yaw_rad, "fp": capture.first_path_index}


def responses(capture):
    return {name: np.asarray(getattr(capture, name)) for name in ("preamble", "sts1", "sts2")}


def numbered(columns):
    """Arrays (frames, taps) as one column a tap."""
    return {f"{name}_{tap}": values[:, tap] for name, values in columns.items() for tap in range(values.shape[1])}


def separate(columns):
    return {f"{name}_{part}": getattr(values, attr) for name, values in columns.items() for part, attr in PARTS}


PARTS = (("i", "real"), ("q", "imag"))


def opened(folder: Path, mapping, **params):
    (folder / "mapping.yaml").write_text(yaml.safe_dump(mapping))
    return open_dataset("table", {"mapping": "mapping.yaml", **params}, [folder])


def write_csv(path, columns):
    pd.DataFrame(columns).to_csv(path, index=False)


def write_parquet(path, columns):
    pd.DataFrame({name: list(v) if v.ndim > 1 else v for name, v in columns.items()}).to_parquet(path)


def write_npz(path, columns):
    np.savez(path, **columns)


def write_mat(path, columns):
    scipy.io.savemat(path, columns)


def write_hdf5(path, columns):
    with h5py.File(path, "w") as file:
        for name, values in columns.items():
            file[name] = values


def write_mat73(path, columns):
    """As MATLAB's ``save -v7.3`` lays arrays out: transposed, vectors as columns, complex as real and imag."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in columns.items():
            stored = np.atleast_2d(values) if values.ndim == 1 else values.T
            if np.iscomplexobj(stored):
                pair = np.empty(stored.shape, [("real", "f4"), ("imag", "f4")])
                pair["real"], pair["imag"] = stored.real, stored.imag
                stored = pair
            file[name] = stored


def magnitude_phase(columns):
    parts = {f"{name}_a": np.abs(values.astype(complex)) for name, values in columns.items()}
    return parts | {f"{name}_p": np.rad2deg(np.angle(values.astype(complex))) for name, values in columns.items()}


def interleaved(columns):
    return {name: np.ascontiguousarray(values).view(np.float32) for name, values in columns.items()}


def in_cells(columns):
    return {name: [json.dumps(row.tolist()) for row in values] for name, values in columns.items()}


LAYOUTS = {
    "csv, I and Q columns": (
        "csv",
        write_csv,
        lambda r: numbered(separate(r)),
        lambda n: {"i": f"{n}_i_{{tap}}", "q": f"{n}_q_{{tap}}"},
    ),
    "csv, magnitude and phase columns": (
        "csv",
        write_csv,
        lambda r: numbered(magnitude_phase(r)),
        lambda n: {"magnitude": f"{n}_a_{{tap}}", "phase": f"{n}_p_{{tap}}", "phase_unit": "deg"},
    ),
    "csv, complex text columns": (
        "csv",
        write_csv,
        lambda r: {k: [str(value).replace("j", "i") for value in v] for k, v in numbered(r).items()},
        lambda n: {"complex": f"{n}_{{tap}}"},
    ),
    "csv, interleaved array in a cell": (
        "csv",
        write_csv,
        lambda r: in_cells(interleaved(r)),
        lambda n: {"interleaved": n},
    ),
    "csv, interleaved numbered columns": (
        "csv",
        write_csv,
        lambda r: numbered(interleaved(r)),
        lambda n: {"interleaved": f"{n}_{{tap}}"},
    ),
    "parquet, I and Q array columns": (
        "parquet",
        write_parquet,
        separate,
        lambda n: {"i": f"{n}_i", "q": f"{n}_q"},
    ),
    "parquet, I and Q columns": (
        "parquet",
        write_parquet,
        lambda r: numbered(separate(r)),
        lambda n: {"i": f"{n}_i_{{tap}}", "q": f"{n}_q_{{tap}}"},
    ),
    "npz, complex array": ("npz", write_npz, dict, lambda n: {"complex": n}),
    "npz, taps by frames": (
        "npz",
        write_npz,
        lambda r: {name: values.T for name, values in r.items()},
        lambda n: {"complex": n, "taps_first": True},
    ),
    "npz, last axis I and Q": (
        "npz",
        write_npz,
        lambda r: {name: np.stack([v.real, v.imag], axis=-1) for name, v in r.items()},
        lambda n: {"interleaved": n},
    ),
    "mat, complex array": ("mat", write_mat, dict, lambda n: {"complex": n}),
    "mat, structure": (
        "mat",
        lambda path, columns: write_mat(path, {"log": columns}),
        dict,
        lambda n: {"complex": f"log.{n}"},
    ),
    "mat 7.3, complex array": ("mat", write_mat73, dict, lambda n: {"complex": n}),
    "hdf5, complex array in a group": (
        "h5",
        write_hdf5,
        lambda r: {f"cir/{name}": values for name, values in r.items()},
        lambda n: {"complex": f"cir/{n}"},
    ),
}
