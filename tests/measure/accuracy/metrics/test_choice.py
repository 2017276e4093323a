"""Which metrics a run shows, in which order, and which one ranks."""

import pytest

from uwbbench.measure.accuracy.metrics.choice import Absent, MetricChoice, combined, names_of

DEFAULT = ["precision", "recall", "f1", "mae", "bias", "scatter", "p90", "p95", "sd", "false_alarms_per_minute"]
DEFAULT += ["matched_mae", "matched_bias", "matched_scatter"]


def test_every_run_shows_the_default_metrics_in_their_own_order():
    assert list(MetricChoice()) == DEFAULT


def test_a_listed_metric_takes_its_own_place():
    assert list(MetricChoice(["bias", "mae"])) == DEFAULT
    names = list(MetricChoice(["ospa", "mae"], ["track"]))
    assert names[names.index("ospa") - 1 : names.index("ospa") + 2] == ["gospa_false", "ospa", "precision"]


def test_open_truth_leaves_out_what_unmatched_detections_decide():
    assert MetricChoice().defined(exhaustive=False) == [
        name for name in DEFAULT if name not in ("precision", "f1", "false_alarms_per_minute")
    ]


@pytest.mark.parametrize(
    ("listed", "exhaustive", "ranks"),
    [
        ([], True, "f1"),
        ([], False, "recall"),
        (["p90"], True, "p90"),
        (["precision"], False, "recall"),
        (["bias", "sd"], True, "f1"),  # neither end of a bias is better
        (["not-installed"], True, "f1"),
    ],
)
def test_the_first_listed_metric_ranks_where_it_can(listed, exhaustive, ranks):
    assert MetricChoice(listed).ranking(exhaustive=exhaustive) == ranks


def test_listed_metrics_come_before_the_default_ones_where_room_is_short():
    assert MetricChoice(["sd"]).headline(exhaustive=True) == ["sd", "f1", "recall", "mae", "p95"]
    assert MetricChoice(["sd"]).compared(exhaustive=True) == ["sd", "f1", "recall", "mae"]
    assert "false_alarms_per_minute" not in MetricChoice().brief
    assert "false_alarms_per_minute" in MetricChoice(["false_alarms_per_minute"]).brief


def test_a_listed_metric_that_is_not_installed_keeps_its_place_and_is_noted():
    metrics = MetricChoice(["not-installed"])
    assert metrics["not-installed"] is Absent
    assert metrics.absent == ("not-installed",)
    assert "no metric named 'not-installed' is installed" in metrics.notes[0]


def test_a_class_that_is_no_metric_is_noted_and_left_out(install_plugin):
    install_plugin("odd", {"metrics": {"odd": "odd_metric:Odd"}}, {"odd_metric.py": "class Odd: pass\n"})
    metrics = MetricChoice()
    assert list(metrics) == DEFAULT
    assert "is no subclass of uwbbench.api.Metric" in metrics.notes[0]


def test_an_experiment_chooses_exactly_what_ranks_what_is_a_column_and_what_is_charted():
    metrics = MetricChoice({"rank": "p95", "table": ["recall", "p95", "bias"], "charts": ["bias"]})
    assert metrics.ranking(exhaustive=True) == "p95"
    assert metrics.defined(exhaustive=True) == ["recall", "p95", "bias"]
    assert list(metrics.brief) == ["recall", "p95", "bias"]
    assert metrics.headline(exhaustive=True) == ["bias"]
    assert metrics.compared(exhaustive=True) == ["p95", "bias"]


def test_what_an_experiment_leaves_open_stays_as_it_is_for_everyone():
    usual, ranked = MetricChoice(), MetricChoice({"rank": "mae"})
    assert ranked.ranking(exhaustive=True) == "mae"
    assert ranked.defined(exhaustive=True) == usual.defined(exhaustive=True)
    assert list(ranked.brief) == list(usual.brief)
    assert ranked.headline(exhaustive=True) == ["mae", "f1", "recall", "p95"]
    columns = MetricChoice({"table": ["mae"]})
    assert columns.headline(exhaustive=True) == usual.headline(exhaustive=True)
    assert columns.ranking(exhaustive=True) == "f1"


def test_the_metric_that_ranks_is_always_a_column():
    metrics = MetricChoice({"rank": "p90", "table": ["mae", "precision"]})
    assert metrics.defined(exhaustive=True) == ["p90", "mae", "precision"]
    assert list(metrics.brief) == ["p90", "mae", "precision"]
    assert MetricChoice({"table": ["mae"]}).defined(exhaustive=False) == ["recall", "mae"]


def test_experiments_that_agree_keep_their_choice_and_others_show_what_any_of_them_has():
    exact = {"rank": "mae", "table": ["mae", "bias"]}
    assert combined([exact, dict(exact)]).defined(exhaustive=True) == ["mae", "bias"]
    both = combined([["sd"], exact])
    assert both.listed == ("sd", "mae", "bias")
    assert both.defined(exhaustive=True) == DEFAULT
    assert names_of([]) == names_of({}) == []


def test_a_scoring_has_the_metrics_that_take_its_outcomes_and_ranks_by_its_own():
    every = MetricChoice((), ["frame", "track"])
    assert list(every.of("frame")) == DEFAULT
    assert set(DEFAULT) < set(every.of("track"))
    assert every.of("track").ranking(exhaustive=True) == "gospa"
    assert every.of("track").ranking(exhaustive=False) == "recall"
    assert every.of("track").error(exhaustive=True) == ["track_rmse"]
    assert "gospa" not in MetricChoice((), ["frame"])


def test_a_listed_metric_is_passed_over_where_it_has_no_meaning():
    metrics = MetricChoice({"rank": "ospa", "table": ["ospa", "bias"], "charts": ["ospa"]}, ["object", "track"])
    assert metrics.of("track").defined(exhaustive=True) == ["ospa", "bias"]
    assert metrics.of("object").ranking(exhaustive=True) == "f1"
    assert metrics.of("object").defined(exhaustive=True) == ["f1", "bias"]
    assert metrics.of("object").headline(exhaustive=True) == ["f1", "recall", "mae", "p95"]


def test_narrow_tables_of_a_scoring_with_metrics_of_its_own_leave_out_those_that_are_no_headline():
    brief = MetricChoice((), ["track"]).brief
    assert {"gospa", "track_rmse", "f1", "mae", "bias", "scatter"} < set(brief)
    assert not {"precision", "p90", "sd", "gospa_missed"} & set(brief)


def test_bias_and_scatter_stand_wherever_their_mean_absolute_error_does():
    for scoring in ("frame", "object", "track", "segment"):
        narrow, every = list(MetricChoice((), [scoring]).brief), list(MetricChoice((), [scoring]))
        for names, start in ((narrow, "mae"), (every, "mae"), (every, "matched_mae")):
            at = names.index(start)
            assert names[at + 1 : at + 3] == [start.replace("mae", "bias"), start.replace("mae", "scatter")]
