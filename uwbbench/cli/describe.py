"""What ``show``, ``info`` and ``validate`` have to say, as plain values."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

from uwbbench.api import registry
from uwbbench.api.errors import ConfigError, PluginError, nearest
from uwbbench.api.locate import find_config, shipped
from uwbbench.api.text import counted, without_markup
from uwbbench.api.yaml_file import read_yaml

_CLASSES = ("stages", "mappers", "datasets", "metrics", "terms")


def everything_named(name: str) -> dict[str, dict[str, Any]]:
    """Facts about each plugin and detector of that name.

    Raises
    ------
    PluginError, ConfigError
        If there is none, or it cannot be loaded.
    """
    facts: dict[str, dict[str, Any]] = {}
    for kind in _CLASSES:
        if name in registry.entries(kind):
            facts[kind[:-1]] = _plugin(kind, name)
    is_file = name.endswith((".yaml", ".yml"))
    if is_file or name in shipped("detectors") or name in registry.entries("detectors"):
        facts["detector"] = _detector(name)
    if not facts:
        known = [*shipped("detectors"), *(known for kind in registry.KINDS for known in registry.entries(kind))]
        raise PluginError(f"no stage, mapper, detector, dataset, metric or term named '{name}'.{nearest(name, known)}")
    return facts


def _plugin(kind: Any, name: str) -> dict[str, Any]:
    cls, entry = registry.load_plugin(kind, name), registry.entry(kind, name)
    doc = without_markup(inspect.getdoc(cls) or "")
    facts: dict[str, Any] = {"package": entry.package, "target": entry.target, "doc": doc}
    if kind == "stages":
        facts["fidelity"] = cls.fidelity
        facts |= {port: sorted(getattr(cls, port)) for port in ("consumes", "produces", "removes", "needs")}
    elif kind == "mappers":
        facts |= {"fidelity": cls.fidelity, "receivers": cls.receivers}
        facts |= {port: sorted(getattr(cls, port)) for port in ("consumes", "needs")}
    elif kind == "datasets":
        card = cls.card
        facts |= {key: getattr(card, key) for key in ("title", "origin", "license", "citation", "source", "folder")}
        facts["files"] = [{"path": file.path, "sha256": file.sha256, "url": file.url} for file in card.files]
        facts["more"] = [{"name": folder.name, "listing": folder.listing} for folder in card.more]
    elif kind == "terms":
        facts["fidelity"] = cls.fidelity
    else:
        shown = (
            "title",
            "unit",
            "better",
            "margin",
            "merge",
            "minimum_samples",
            "default",
            "order",
            "brief",
            "headline",
        )
        facts |= {key: getattr(cls, key) for key in shown}
    if kind != "metrics":
        facts["params"] = parameters(cls.params_type())
    return facts


def parameters(model: Any) -> list[dict[str, Any]]:
    """Name, type, default and description of each parameter of a pydantic model."""
    schema = model.model_json_schema()
    rows = []
    for name, field in schema.get("properties", {}).items():
        required = name in schema.get("required", ())
        default = (
            "required"
            if required
            else _yaml_value(field.get("default", model.model_fields[name].get_default(call_default_factory=True)))
        )
        row = {"name": name, "type": _type_text(field, schema.get("$defs", {})), "default": default}
        rows.append({**row, "description": without_markup(field.get("description", ""))})
    return rows


def _yaml_value(value: Any) -> str:
    words = {None: "null", True: "true", False: "false"}
    return words[value] if value is None or isinstance(value, bool) else str(value)


def _type_text(field: dict[str, Any], definitions: dict[str, Any]) -> str:
    """Type of a JSON Schema property in words.

    Examples
    --------
    >>> _type_text({"type": "integer", "minimum": 1}, {})
    'integer >= 1'
    """
    if "$ref" in field:
        return _type_text(definitions[field["$ref"].rsplit("/", 1)[1]], definitions)
    if "enum" in field:
        return " | ".join(map(str, field["enum"]))
    if "const" in field:
        return str(field["const"])
    if "anyOf" in field:
        return " or ".join(_type_text(option, definitions) for option in field["anyOf"])
    text = str(field.get("type", "any"))
    if text == "array":
        items = field.get("prefixItems") or [field.get("items", {})]
        text = f"list of {' and '.join(dict.fromkeys(_type_text(item, definitions) for item in items))}"
    signs = {"minimum": ">=", "exclusiveMinimum": ">", "maximum": "<=", "exclusiveMaximum": "<"}
    limits = [f"{sign} {field[key]:g}" for key, sign in signs.items() if key in field]
    return " ".join([text, ", ".join(limits)]).strip()


def _detector(name: str) -> dict[str, Any]:
    from uwbbench.detect.pipeline import load_detector

    config = load_detector(name).config
    reported = [one.model_dump() for one in config.reported]
    about = {"description": config.description, "citation": config.citation, "reported": reported, **config.to_dict()}
    return {"file": str(find_config("detectors", name)), **about}


def detector_yaml(facts: dict[str, Any]) -> str:
    """Detector as a YAML file that could be loaded again, its origin in a comment."""
    import yaml

    order = ("schema", "name", "description", "citation", "fidelity", "reported")
    head = {key: facts[key] for key in order if facts[key]}
    text = yaml.safe_dump(head, sort_keys=False, allow_unicode=True, width=110) + "pipeline:\n"
    for step in facts["pipeline"]:
        line = yaml.safe_dump(_without_defaults(step), sort_keys=False, default_flow_style=True, width=10_000)
        text += f"  - {line}"
    if "mapper" in facts:
        text += "mapper: " + yaml.safe_dump(facts["mapper"], sort_keys=False, default_flow_style=True, width=10_000)
    return f"# resolved from {facts['file']}\n{text}"


def _without_defaults(step: dict[str, Any]) -> dict[str, Any]:
    kept = {"use": step["use"]}
    if step["as"] != step["use"]:
        kept["as"] = step["as"]
    return kept | {key: step[key] for key in ("params", "optional", "unless") if step.get(key)}


def capture_file(path: Path) -> dict[str, Any]:
    """Facts about every receiver of a capture file; all samples are read once, to count invalid frames."""
    from uwbbench.api.capture_file import list_receivers, open_capture
    from uwbbench.run.folder.identity import plain

    captures = [open_capture(path, name) for name in list_receivers(path)]
    first = captures[0]
    radar = first.radar.to_dict()
    common = (
        "model",
        "channel",
        "center_frequency_hz",
        "bandwidth_hz",
        "sample_interval_s",
        "frame_rate_hz",
        "samples",
    )
    channel = f"channel {first.radar.channel}, " if first.radar.channel else ""
    text = (
        f"{first.radar.model}, {channel}{first.radar.center_frequency_hz / 1e6:.1f} MHz, "
        f"bandwidth {first.radar.bandwidth_hz / 1e6:.1f} MHz, {first.radar.samples} samples "
        f"every {first.radar.sample_interval_s * 1e9:.4f} ns, {first.radar.frame_rate_hz:g} frames/s"
    )
    truth = None
    if first.truth is not None:
        keys = ("name", "material", "structure", "moves")
        objects = [{key: getattr(obstacle, key) for key in keys} for obstacle in first.truth.objects]
        truth = {"exhaustive": first.truth.exhaustive, "objects": objects}
    about = {
        key: getattr(first, key)
        for key in ("name", "source", "license", "citation", "description", "recording", "robot")
    }
    facts = {
        **about,
        "file": str(path),
        "radar": {**{key: radar[key] for key in common}, "text": text},
        "receivers": [_receiver(capture) for capture in captures],
        "truth": truth,
    }
    return dict(plain(facts))


def _invalid(capture: Any) -> int:
    """Invalid frames; all samples are read."""
    return sum(int((~frames.valid).sum()) for frames in capture.blocks(4096))


def _background(background: Any) -> dict[str, Any]:
    return {"name": background.name, "frames": len(background), "invalid_frames": _invalid(background)}


def _receiver(capture: Any) -> dict[str, Any]:
    radar = capture.radar
    return {
        "receiver": radar.receiver,
        "frames": len(capture),
        "taps": radar.taps,
        "duration_s": capture.duration_s,
        "invalid_frames": _invalid(capture),
        "sts": radar.has_sts,
        "first_path": radar.has_first_path,
        "noise_taps": radar.noise_taps,
        "window_m": radar.window_m,
        "baseline_m": radar.baseline_length_m,
        "mount_position_m": radar.mount_position_m,
        "mount_yaw_rad": radar.mount_yaw_rad,
        "array_spacing_m": radar.array_spacing_m,
        "first_tap_delay_s": radar.first_tap_delay_s,
        "background": None if capture.background is None else _background(capture.background),
    }


def receiver_texts(receivers: list[dict[str, Any]]) -> list[dict[str, str]]:
    """A row of a table for each receiver, numbers with units."""
    with_background = any(receiver["background"] for receiver in receivers)
    return [_receiver_text(receiver, with_background) for receiver in receivers]


def _receiver_text(receiver: dict[str, Any], with_background: bool) -> dict[str, str]:
    background = f"{receiver['background']['frames']} frames" if receiver["background"] else "none"
    return {
        "receiver": receiver["receiver"],
        "frames": str(receiver["frames"]),
        "taps": str(receiver["taps"]),
        "duration": f"{receiver['duration_s']:.2f} s",
        "invalid frames": str(receiver["invalid_frames"]),
        "STS": "yes" if receiver["sts"] else "no",
        "first path": "reported" if receiver["first_path"] else "not reported",
        "range window": f"{receiver['window_m']:.2f} m",
        "TX to RX": f"{receiver['baseline_m']:.3f} m",
        **({"background": background} if with_background else {}),
    }


def checked_file(path: Path) -> str:
    """Summary of a detector, experiment, scene, gate, tuning, training, fit or robot file that passed all checks.

    Raises
    ------
    ConfigError, PluginError
        If it is wrong, or none of the eight.
    """
    from uwbbench.config.source import open_dataset
    from uwbbench.detect.pipeline import load_detector
    from uwbbench.run.experiment import read_experiment
    from uwbbench.tools.fit import read_fit
    from uwbbench.tools.gate import read_gate
    from uwbbench.tools.train import read_training
    from uwbbench.tools.tune import read_tuning

    keys = read_yaml(path).data
    if "tuning" in keys:
        tuning = read_tuning(path)
        return f"tuning '{tuning.name}', {len(tuning.tuning)} datasets to tune on, fine"
    if "training" in keys:
        training = read_training(path)
        learned = counted(len(training.training), "dataset")
        return f"training '{training.name}' of {training.step.use}, {learned} to learn from, fine"
    if "cells" in keys:
        fit = read_fit(path)
        return f"fit '{fit.name}', {len(fit.start)} parameters, {len(fit.targets)} targets, fine"
    if "head" in keys:
        gate = read_gate(path)
        return f"gate '{gate.name}', {len(gate.datasets)} datasets, fine"
    of_experiments = keys.keys() & {"detectors", "datasets", "experiments"}
    if "pipeline" not in keys and (of_experiments or _extends_experiment(path, keys)):
        experiment = read_experiment(path)
        return f"experiment '{experiment.name}', {len(experiment.detectors)} detectors, fine"
    if "pipeline" in keys or "extends" in keys:
        pipeline = load_detector(path if path.is_absolute() else Path.cwd() / path)
        return f"detector '{pipeline.name}', {len(pipeline.config.steps)} steps, fine"
    if "terms" in keys or "trajectory" in keys:
        captures = open_dataset(registry.default("dataset.scenes"), {"scenes": [str(path.resolve())]}, ()).names()
        return f"scene of {len(captures)} captures, fine"
    if "channels" in keys:
        robot = registry.load_plugin("datasets", registry.default("dataset.scenes")).read_robot(path).model
        return f"robot '{robot.name}' on channels {', '.join(map(str, robot.channels))}, fine"
    first_keys = ["pipeline", "extends", "detectors", "datasets", "terms", "head", "tuning", "training", "cells"]
    first_keys += ["experiments", "channels"]
    near = [nearest(str(key), first_keys) for key in keys if key != "schema"]
    hint = next((text for text in near if text.startswith(" Did")), "")
    kinds = (
        "a detector ('pipeline' or 'extends'), an experiment ('detectors'), a scene ('terms'), a gate ('head'), a "
        "tuning ('tuning'), a training ('training'), a fit ('cells') nor a robot ('channels')"
    )
    raise ConfigError(f"{path}: neither {kinds}.{hint}")


def _extends_experiment(path: Path, keys: dict[str, Any]) -> bool:
    """Whether a file that only extends another, and says no more of what it is, extends an experiment."""
    parent = keys.get("extends")
    if not isinstance(parent, str):
        return False
    try:
        experiment = find_config("experiments", parent, path.parent)
    except ConfigError:
        return False
    return "detectors" in read_yaml(experiment).data
