"""All that a plugin author may import.

Names load on first use, so that listing plugins or printing a help text does not import numpy.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from uwbbench.api.aligned import AlignedProfile, Bins, WindowProfile
    from uwbbench.api.anchors import Anchors, Messages
    from uwbbench.api.apart import in_child
    from uwbbench.api.arrays import BoolArray, ComplexArray, FloatArray, IntArray
    from uwbbench.api.block import Block
    from uwbbench.api.bounds import check_columns, check_unfolded
    from uwbbench.api.capture import Capture, CaptureHeader, Samples, analytic
    from uwbbench.api.capture_file import list_receivers, open_capture
    from uwbbench.api.capture_writing import write_capture
    from uwbbench.api.case import Evidence, NotApplicable, Violation, cases_of, hard_case
    from uwbbench.api.check import checked
    from uwbbench.api.compiling import compiled, inlined
    from uwbbench.api.dataset import Card, Dataset, DatasetFile, DatasetFolder
    from uwbbench.api.detections import COLUMNS, Detections
    from uwbbench.api.direct_path import MINIMUM_ECHOES, DirectPath, Located, doubt, stated_pulse
    from uwbbench.api.drive import Drive, compose, odometry_of, relative
    from uwbbench.api.errors import (
        CaptureError,
        ConfigError,
        PluginError,
        ScoringError,
        StoreError,
        UwbbenchError,
        nearest,
    )
    from uwbbench.api.filters import Limit, LimitFilter, RankFilter, RankParams
    from uwbbench.api.frames import Frames, magnitude
    from uwbbench.api.geometry import (
        SPEED_OF_LIGHT_M_S,
        bistatic_range,
        bistatic_range_sine,
        direction,
        nearest_on_outline,
        receiver_pose,
        rotate_z,
        segments_cross,
        to_world,
        wrap_angle,
        wrap_one_angle,
    )
    from uwbbench.api.kernel import Kernel
    from uwbbench.api.learning import Assessed, Example, LearnedParams, Trainable, Weights, expect_arrays
    from uwbbench.api.locate import find_config
    from uwbbench.api.mapper import LANDMARK_KINDS, Grid, LandmarkKind, Landmarks, Map, Mapped, Mapper, Poses, Step
    from uwbbench.api.metric import Metric, Outcome
    from uwbbench.api.numba_internals import as_tuple
    from uwbbench.api.outcomes import MapOutcome, PoseOutcome, PresenceOutcome, SegmentOutcome, TrackOutcome
    from uwbbench.api.override import with_values
    from uwbbench.api.radar import CHANNEL_CENTER_HZ, Radar
    from uwbbench.api.recording import leak_key, leaks, simulated_recording
    from uwbbench.api.registry import load_plugin
    from uwbbench.api.stage import Fidelity, Filter, P, Params, Stage, ports
    from uwbbench.api.term import EchoFading, EchoTail, Paths, Pulse, Responses, SceneAnchor, SceneObject, Term, View
    from uwbbench.api.trial import StagesOnTrial, exact_ulps
    from uwbbench.api.truth import Obstacle, Sight, Trajectory, Truth
    from uwbbench.api.yaml_file import YamlFile, read_yaml

_HOME = {
    "aligned": ("AlignedProfile", "Bins", "WindowProfile"),
    "anchors": ("Anchors", "Messages"),
    "apart": ("in_child",),
    "arrays": ("BoolArray", "ComplexArray", "FloatArray", "IntArray"),
    "block": ("Block",),
    "bounds": ("check_columns", "check_unfolded"),
    "capture": ("Capture", "CaptureHeader", "Samples", "analytic"),
    "capture_file": ("list_receivers", "open_capture"),
    "capture_writing": ("write_capture",),
    "case": ("Evidence", "NotApplicable", "Violation", "cases_of", "hard_case"),
    "check": ("checked",),
    "compiling": ("compiled", "inlined"),
    "dataset": ("Card", "Dataset", "DatasetFile", "DatasetFolder"),
    "detections": ("COLUMNS", "Detections"),
    "direct_path": ("MINIMUM_ECHOES", "DirectPath", "Located", "doubt", "stated_pulse"),
    "drive": ("Drive", "compose", "odometry_of", "relative"),
    "errors": ("CaptureError", "ConfigError", "PluginError", "ScoringError", "StoreError", "UwbbenchError", "nearest"),
    "filters": ("Limit", "LimitFilter", "RankFilter", "RankParams"),
    "frames": ("Frames", "magnitude"),
    "geometry": (
        "SPEED_OF_LIGHT_M_S",
        "bistatic_range",
        "bistatic_range_sine",
        "direction",
        "nearest_on_outline",
        "receiver_pose",
        "rotate_z",
        "segments_cross",
        "to_world",
        "wrap_angle",
        "wrap_one_angle",
    ),
    "kernel": ("Kernel",),
    "learning": ("Assessed", "Example", "LearnedParams", "Trainable", "Weights", "expect_arrays"),
    "locate": ("find_config",),
    "mapper": ("LANDMARK_KINDS", "Grid", "LandmarkKind", "Landmarks", "Map", "Mapped", "Mapper", "Poses", "Step"),
    "metric": ("Metric", "Outcome"),
    "numba_internals": ("as_tuple",),
    "outcomes": ("MapOutcome", "PoseOutcome", "PresenceOutcome", "SegmentOutcome", "TrackOutcome"),
    "override": ("with_values",),
    "radar": ("CHANNEL_CENTER_HZ", "Radar"),
    "recording": ("leak_key", "leaks", "simulated_recording"),
    "registry": ("load_plugin",),
    "stage": ("Fidelity", "Filter", "P", "Params", "Stage", "ports"),
    "term": ("EchoFading", "EchoTail", "Paths", "Pulse", "Responses", "SceneAnchor", "SceneObject", "Term", "View"),
    "trial": ("StagesOnTrial", "exact_ulps"),
    "truth": ("Obstacle", "Sight", "Trajectory", "Truth"),
    "yaml_file": ("YamlFile", "read_yaml"),
}
_MODULE_OF = {name: module for module, names in _HOME.items() for name in names}

__all__ = [
    "CHANNEL_CENTER_HZ",
    "COLUMNS",
    "LANDMARK_KINDS",
    "MINIMUM_ECHOES",
    "SPEED_OF_LIGHT_M_S",
    "AlignedProfile",
    "Anchors",
    "Assessed",
    "Bins",
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
    "DatasetFolder",
    "Detections",
    "DirectPath",
    "Drive",
    "EchoFading",
    "EchoTail",
    "Evidence",
    "Example",
    "Fidelity",
    "Filter",
    "FloatArray",
    "Frames",
    "Grid",
    "IntArray",
    "Kernel",
    "LandmarkKind",
    "Landmarks",
    "LearnedParams",
    "Limit",
    "LimitFilter",
    "Located",
    "Map",
    "MapOutcome",
    "Mapped",
    "Mapper",
    "Messages",
    "Metric",
    "NotApplicable",
    "Obstacle",
    "Outcome",
    "P",
    "Params",
    "Paths",
    "PluginError",
    "PoseOutcome",
    "Poses",
    "PresenceOutcome",
    "Pulse",
    "Radar",
    "RankFilter",
    "RankParams",
    "Responses",
    "Samples",
    "SceneAnchor",
    "SceneObject",
    "ScoringError",
    "SegmentOutcome",
    "Sight",
    "Stage",
    "StagesOnTrial",
    "Step",
    "StoreError",
    "Term",
    "TrackOutcome",
    "Trainable",
    "Trajectory",
    "Truth",
    "UwbbenchError",
    "View",
    "Violation",
    "Weights",
    "WindowProfile",
    "YamlFile",
    "analytic",
    "as_tuple",
    "bistatic_range",
    "bistatic_range_sine",
    "cases_of",
    "check_columns",
    "check_unfolded",
    "checked",
    "compiled",
    "compose",
    "direction",
    "doubt",
    "exact_ulps",
    "expect_arrays",
    "find_config",
    "hard_case",
    "in_child",
    "inlined",
    "leak_key",
    "leaks",
    "list_receivers",
    "load_plugin",
    "magnitude",
    "nearest",
    "nearest_on_outline",
    "odometry_of",
    "open_capture",
    "ports",
    "read_yaml",
    "receiver_pose",
    "relative",
    "rotate_z",
    "segments_cross",
    "simulated_recording",
    "stated_pulse",
    "to_world",
    "with_values",
    "wrap_angle",
    "wrap_one_angle",
    "write_capture",
]


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'uwbbench.api' has no attribute '{name}'")
    return getattr(importlib.import_module(f"uwbbench.api.{_MODULE_OF[name]}"), name)
