"""All that a plugin author may import.

Names load on first use, so that listing plugins or printing a help text does not import numpy.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from uwbbench.api.arrays import BoolArray, ComplexArray, FloatArray, IntArray
    from uwbbench.api.block import Block
    from uwbbench.api.capture import Capture, CaptureHeader, Samples, analytic
    from uwbbench.api.capture_file import open_capture, write_capture
    from uwbbench.api.check import checked
    from uwbbench.api.dataset import Card, Dataset, DatasetFile
    from uwbbench.api.detections import COLUMNS, Detections
    from uwbbench.api.errors import (
        CaptureError,
        ConfigError,
        PluginError,
        ScoringError,
        StoreError,
        UwbbenchError,
        nearest,
    )
    from uwbbench.api.frames import Frames, magnitude
    from uwbbench.api.geometry import SPEED_OF_LIGHT_M_S
    from uwbbench.api.kernel import Kernel
    from uwbbench.api.metric import Metric, Outcome
    from uwbbench.api.radar import Radar
    from uwbbench.api.stage import Filter, Params, Stage, ports
    from uwbbench.api.term import Paths, Pulse, Responses, SceneObject, Term, View
    from uwbbench.api.truth import Obstacle, Sight, Trajectory, Truth
    from uwbbench.api.yaml_file import YamlFile, read_yaml

_HOME = {
    "arrays": ("BoolArray", "ComplexArray", "FloatArray", "IntArray"),
    "block": ("Block",),
    "capture": ("Capture", "CaptureHeader", "Samples", "analytic"),
    "capture_file": ("open_capture", "write_capture"),
    "check": ("checked",),
    "dataset": ("Card", "Dataset", "DatasetFile"),
    "detections": ("COLUMNS", "Detections"),
    "errors": (
        "CaptureError",
        "ConfigError",
        "PluginError",
        "ScoringError",
        "StoreError",
        "UwbbenchError",
        "nearest",
    ),
    "frames": ("Frames", "magnitude"),
    "geometry": ("SPEED_OF_LIGHT_M_S",),
    "kernel": ("Kernel",),
    "metric": ("Metric", "Outcome"),
    "radar": ("Radar",),
    "stage": ("Filter", "Params", "Stage", "ports"),
    "term": ("Paths", "Pulse", "Responses", "SceneObject", "Term", "View"),
    "truth": ("Obstacle", "Sight", "Trajectory", "Truth"),
    "yaml_file": ("YamlFile", "read_yaml"),
}
_MODULE_OF = {name: module for module, names in _HOME.items() for name in names}

__all__ = [
    "COLUMNS",
    "SPEED_OF_LIGHT_M_S",
    "Block",
    "BoolArray",
    "Capture",
    "CaptureError",
    "CaptureHeader",
    "Card",
    "ComplexArray",
    "ConfigError",
    "Dataset",
    "DatasetFile",
    "Detections",
    "Filter",
    "FloatArray",
    "Frames",
    "IntArray",
    "Kernel",
    "Metric",
    "Obstacle",
    "Outcome",
    "Params",
    "Paths",
    "PluginError",
    "Pulse",
    "Radar",
    "Responses",
    "Samples",
    "SceneObject",
    "ScoringError",
    "Sight",
    "Stage",
    "StoreError",
    "Term",
    "Trajectory",
    "Truth",
    "UwbbenchError",
    "View",
    "YamlFile",
    "analytic",
    "checked",
    "magnitude",
    "nearest",
    "open_capture",
    "ports",
    "read_yaml",
    "write_capture",
]


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'uwbbench.api' has no attribute '{name}'")
    return getattr(importlib.import_module(f"uwbbench.api.{_MODULE_OF[name]}"), name)
