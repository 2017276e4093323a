"""Comparison with physical limits: the bounds, and what a run over test signals says."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from tests.fixtures.chance import SIGMAS, plausible, seed
from uwbbench.results import Report
from uwbbench.results.limits import cramer_rao_range_m, rms_bandwidth_hz
from uwbbench.run import run_experiment
from uwbbench.run.experiment import read_experiment
from uwbbench.run.folder.identity import plain
from uwbbench.show.text.report import markdown, sheets

EXPERIMENT = f"""
schema: 1
detectors:
  - paper-subsample
  - background-mean
  - use: cfar-ca
    name: cells
    set: {{pipeline.cfar.ca.params.cells: all, pipeline.cfar.ca.params.noise: correlated}}
datasets:
  - {{use: limits, name: echo, params: {{scene: echo, snr_db: 20, frames: 3000, seed: {seed()}}}}}
  - {{use: limits, name: close, params: {{scene: pair, snr_db: 25, separation_ns: 1.0, frames: 300, seed: {seed()}}}}}
  - {{use: limits, name: apart, params: {{scene: pair, snr_db: 25, separation_ns: 5.0, frames: 300, seed: {seed()}}}}}
  - {{use: limits, name: noise, params: {{scene: noise, snr_db: 20, frames: 8000, seed: {seed()}}}}}
scoring: object
latency: false
stability: false
"""


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Report:
    """Report of a small run over test signals."""
    folder = tmp_path_factory.mktemp("limits")
    (folder / "small.yaml").write_text(EXPERIMENT)
    return Report(run_experiment(read_experiment(folder / "small.yaml"), folder / "run", jobs=1))


def test_rms_bandwidth_is_the_second_moment_of_the_raised_cosine_spectrum() -> None:
    symbol_s, roll_off = 2e-9, 0.5
    low, high = (1 - roll_off) / (2 * symbol_s), (1 + roll_off) / (2 * symbol_s)

    def spectrum(f: float) -> float:
        return 1.0 if f <= low else 0.5 * (1 + np.cos(np.pi * symbol_s / roll_off * (f - low)))

    spread, power = (quad(lambda f, n=n: f**n * spectrum(f), 0, high, points=[low])[0] for n in (2, 0))
    assert rms_bandwidth_hz(symbol_s, roll_off) == pytest.approx(np.sqrt(spread / power), rel=1e-6)


def test_the_bound_is_the_inverse_fisher_information_of_a_sampled_pulse() -> None:
    """Delay, amplitude and phase unknown, by finite differences of the likelihood's mean over 1 ns taps."""
    step_hz, snr = 1e6, 10 ** (20 / 10)
    f = np.arange(-375e6, 375e6, step_hz)
    low = 125e6
    shape = np.where(np.abs(f) <= low, 1.0, 0.5 * (1 + np.cos(np.pi * (np.abs(f) - low) / 250e6)))
    weight = shape / shape.sum() * 2 * snr  # information by frequency, white after the matched filter
    slopes = np.stack([-2j * np.pi * f, np.ones_like(f, complex), 1j * np.ones_like(f)])
    fisher = np.real((slopes.conj() * weight) @ slopes.T)
    delay_s = np.sqrt(np.linalg.inv(fisher)[0, 0])
    assert cramer_rao_range_m(20) == pytest.approx(delay_s * 299_792_458 / 2, rel=1e-3)


@pytest.mark.parametrize(("snr_db", "expected_cm"), [(10, 3.46), (15, 1.95), (20, 1.09), (25, 0.62), (30, 0.35)])
def test_the_bound_has_the_tabulated_values(snr_db: float, expected_cm: float) -> None:
    assert 100 * cramer_rao_range_m(snr_db) == pytest.approx(expected_cm, abs=0.006)


@pytest.mark.slow
def test_no_detector_beats_the_bound_where_all_echoes_are_found(report: Report) -> None:
    table = report.limits.accuracy
    assert table["detector"].tolist() == ["paper-subsample", "background-mean"]
    assert (table["share"] > 0.99).all()  # 18 misses of 1800 where 1 or 2 are expected
    standard_error = 1 / np.sqrt(2 * table["n"])  # of a root mean square of n errors, relative
    assert (table["ratio"] > 1 - SIGMAS * standard_error).all()
    assert (table["ratio"] < 1.2 + SIGMAS * standard_error).all()


def test_detection_fails_beside_the_direct_path_only(report: Report) -> None:
    table = report.limits.detection.set_index(["detector", "near_m"])
    assert table.loc[("paper-subsample", 0.2), "high"] < table.loc[("paper-subsample", 1.0), "low"]
    assert table.loc[("paper-subsample", 1.0), "share"] > 0.99
    assert ((table["low"] <= table["share"]) & (table["share"] <= table["high"])).all()


def test_the_blind_zone_of_the_peak_detector_is_about_the_pulse(report: Report) -> None:
    radius_m = report.limits.blind_zone.set_index("detector")["radius_m"]
    # Of echoes at 0.2 to 0.3, 0.4, 0.5 and 0.6 m, 0, 35, 82 and 100 % are found; there are 50 in each span.
    assert 0.3 <= radius_m["paper-subsample"] <= 0.5
    assert radius_m["background-mean"] < radius_m["paper-subsample"]


def test_two_echoes_are_resolved_when_they_stand_apart(report: Report) -> None:
    table = report.limits.resolution.set_index(["detector", "separation_ns"])
    found = (table["share"] * table["n"]).round()["background-mean"]
    n = table["n"]["background-mean"]
    assert n[5.0] - found[5.0] in plausible(0.006, n[5.0])
    assert found[1.0] in plausible(0.07, n[1.0])
    assert table["share"]["paper-subsample", 5.0] == 0.0


def test_measured_false_alarms_agree_with_the_requested_rate(report: Report) -> None:
    row = report.limits.false_alarms.set_index("detector").loc["cells"]
    assert row["requested"] == 1e-3
    standard_error = (row["high"] - row["low"]) / (2 * norm.isf(0.025))
    assert row["share"] == pytest.approx(1e-3, abs=SIGMAS * standard_error)
    assert standard_error < 0.1 * 1e-3
    assert np.isnan(report.limits.false_alarms.set_index("detector").loc["paper-subsample", "requested"])


def test_limits_are_shown_as_simulated_and_exported(report: Report) -> None:
    titles = [sheet.title for sheet in sheets(report) if sheet.title.startswith("Limits")]
    assert len(titles) == 5
    assert all("SIMULATED" in title for title in titles)
    assert "Cramer-Rao bound" in markdown(report)
    assert len(plain(report.to_dict())["limits"]["accuracy"]) == 2


def test_a_run_without_test_signals_has_no_limits(tmp_path: Path) -> None:
    head = "schema: 1\ndetectors: [oracle]\nlatency: false\nstability: false\n"
    text = head + "datasets: [{use: approach, params: {speed_m_s: 3.0}}]\n"
    (tmp_path / "plain.yaml").write_text(text)
    made = Report(run_experiment(read_experiment(tmp_path / "plain.yaml"), tmp_path / "run", jobs=1))
    assert made.to_dict()["limits"] == {}
    assert not [sheet for sheet in sheets(made) if sheet.title.startswith("Limits")]
