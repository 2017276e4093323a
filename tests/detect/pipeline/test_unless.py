"""Steps that stand in for an optional one."""

import dataclasses

import pytest

from uwbbench import load_detector
from uwbbench.api import ConfigError
from uwbbench.detect.pipeline import detector_from_yaml
from uwbbench.tools.check.inputs import usual_capture

STEPS = """
schema: 1
name: mine
pipeline:
  - {{use: clutter.template, optional: true, params: {{source: background}}}}
  - {{use: clutter.exponential, unless: {unless}}}
  - {{use: cfar.ca}}
"""


@pytest.mark.parametrize(
    ("background", "used", "left_out"),
    [(True, "clutter.template", "clutter.exponential"), (False, "clutter.exponential", "clutter.template")],
)
def test_a_step_is_in_use_only_where_the_one_it_stands_in_for_is_not(background, used, left_out):
    stream = detector_from_yaml(STEPS.format(unless="clutter.template")).open(usual_capture(background=background))
    assert [type(stage).__name__ for stage in stream.stages][:1] == [
        {"clutter.template": "TemplateClutter", "clutter.exponential": "ExponentialClutter"}[used]
    ]
    assert any("left out" in note and left_out in note for note in stream.notes)


def test_a_step_can_only_stand_in_for_an_optional_one_before_it():
    with pytest.raises(ConfigError, match=r"no optional step 'clutter.mean'.*clutter.template"):
        detector_from_yaml(STEPS.format(unless="clutter.mean"))


def test_what_a_step_stands_in_for_is_part_of_the_detector():
    steps = load_detector("background-cfar-kalman").config.to_dict()["pipeline"]
    assert [step.get("unless") for step in steps][2:4] == [None, "clutter.template"]
    assert "unless" not in load_detector("paper").config.to_dict()["pipeline"][0]


def test_without_a_background_a_template_of_one_is_refused():
    capture = dataclasses.replace(usual_capture(), background=None)
    detector = detector_from_yaml(
        STEPS.format(unless="clutter.template")
        .replace("optional: true, ", "", 1)
        .replace("  - {use: clutter.exponential, unless: clutter.template}\n", "")
    )
    with pytest.raises(ConfigError, match="has no background"):
        detector.open(capture)
