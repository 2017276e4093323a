"""Gates, tuning, pictures and classes of one's own, from Python."""

import math

import pytest

import uwbbench
from tests.conftest import simulated_approach
from uwbbench.api import Block, BoolArray, ConfigError, Filter, Params, PluginError, ports, registry

NEAR = """
schema: 1
name: near
pipeline: [{use: peaks}, {use: filter.near}, {use: select.strongest}, {use: range}]
"""


class Near(Filter[Params]):
    """Keeps the first taps."""

    consumes = ports("detections", "tap")

    def keep(self, block: Block) -> BoolArray:
        return block.detections["tap"] < 20


@pytest.fixture
def registered():
    """A stage of this process, forgotten afterwards."""
    uwbbench.register("stages", "filter.near", Near)
    yield
    del registry._registered["stages", "filter.near"]
    registry.entries.cache_clear()
    registry.load_plugin.cache_clear()


@pytest.fixture(scope="module")
def capture():
    return simulated_approach(speed_m_s=3.0)


@pytest.mark.slow
def test_a_gate_from_a_mapping_gives_checks_with_limits():
    accuracy = [{"metric": "f1", "scoring": "frame", "minimum": 0.9}]
    plates = [{"use": "approach", "params": {"speed_m_s": 3.0}}]
    result = uwbbench.gate({"head": "cfar-os", "datasets": plates, "accuracy": accuracy})
    (check,) = result.checks
    assert check.limit == 0.9
    assert check.value > 0.9


def test_a_gate_without_limits_is_refused():
    with pytest.raises(ConfigError, match="gate: nothing to check"):
        uwbbench.gate({"head": "cfar-os", "datasets": [{"use": "approach"}]})


@pytest.mark.slow
def test_a_tuning_from_a_mapping_leaves_detectors_and_a_picture(tmp_path):
    tuning = {
        "detector": "paper-filtering",
        "grid": {"pipeline.filter.prominence.params.minimum": {"start": 0.01, "stop": 0.1, "count": 4}},
        "tuning": [{"use": "approach", "params": {"speed_m_s": 3.0}}],
        "held_out": [{"use": "approach", "params": {"speed_m_s": 3.0, "seed": 7}}],
        "groups": ["overall"],
    }
    outcome = uwbbench.tune(tuning, tmp_path / "tuned", figure=tmp_path / "zone.png")
    assert 0.01 <= outcome.groups[0].values["pipeline.filter.prominence.params.minimum"] <= 0.1
    assert len(list((tmp_path / "tuned").glob("*.yaml"))) == 1
    assert (tmp_path / "zone.png").read_bytes().startswith(b"\x89PNG")


def test_a_capture_is_drawn_with_a_detector(capture, tmp_path):
    assert uwbbench.plot("radargram", capture, tmp_path / "a.png", detector="paper").stat().st_size > 10_000


def test_a_run_is_drawn_from_what_it_stored(made, tmp_path):
    assert uwbbench.plot("cdf", made, tmp_path / "a.svg").read_text().count("SIMULATED") >= 1


@pytest.mark.parametrize(
    ("kind", "name", "expected"),
    [("radrgram", "a.png", "Did you mean 'radargram'"), ("radargram", "a.docx", "expected a name that ends in .png")],
)
def test_a_wrong_picture_is_refused(capture, kind, name, expected, tmp_path):
    with pytest.raises(ConfigError, match=expected):
        uwbbench.plot(kind, capture, tmp_path / name)


def test_a_registered_stage_is_used_by_its_name(registered, capture):
    found = uwbbench.detector_from_yaml(NEAR).run(capture)
    assert len(found) > 0
    assert found["tap"].max() < 20


def test_a_registered_stage_may_be_given_again(registered):
    uwbbench.register("stages", "filter.near", Near)
    assert registry.load_plugin("stages", "filter.near") is Near


def test_a_registered_stage_takes_part_in_a_run_of_this_process(registered, tmp_path):
    (tmp_path / "near.yaml").write_text(NEAR)
    experiment = {
        "detectors": [str(tmp_path / "near.yaml")],
        "datasets": [{"use": "approach", "params": {"speed_m_s": 3.0}}],
        "latency": False,
        "stability": False,
    }
    run = uwbbench.run(experiment, tmp_path / "run", jobs=1)
    assert set(run.units["status"]) == {"done"}
    assert not math.isnan(run.leaderboard["recall"].iloc[0])


@pytest.mark.parametrize("change", [{"latency": True}, {}])
def test_a_registered_stage_is_not_sent_to_processes_that_do_not_know_it(registered, change, tmp_path):
    (tmp_path / "near.yaml").write_text(NEAR)
    experiment = {"detectors": [str(tmp_path / "near.yaml")], "datasets": [{"use": "approach"}], "latency": False}
    with pytest.raises(ConfigError, match="registered in this process alone"):
        uwbbench.run(experiment | change, tmp_path / "run", jobs=1 if change else None)


@pytest.mark.parametrize(
    ("kind", "name", "plugin", "expected"),
    [
        ("stages", "peaks", Near, "give yours another name"),
        ("stage", "filter.near", Near, "expected one of stages"),
        ("stages", "filter.near", Near(Params()), "expected a class"),
    ],
)
def test_a_registration_that_cannot_work_is_refused(kind, name, plugin, expected):
    with pytest.raises(PluginError, match=expected):
        uwbbench.register(kind, name, plugin)
