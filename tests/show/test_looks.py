"""Every detector looks like no other, and in charts as in tables."""

from uwbbench.show.charts.chart import Series
from uwbbench.show.looks import looks


def test_none_of_forty_detectors_looks_like_another() -> None:
    names = [f"detector {place}" for place in range(40)]
    assert len(set(looks(names).values())) == 40


def test_a_detector_keeps_its_look_in_a_chart_of_few() -> None:
    names = {name: f"label of {name}" for name in ("a", "b", "c")}
    of_all = looks(names.values())
    encoding = Series(names, ["label of c"]).encoding()
    assert encoding["color"]["scale"]["range"] == [of_all["label of c"].colour]
    assert encoding["shape"]["scale"]["range"] == [of_all["label of c"].shape]
