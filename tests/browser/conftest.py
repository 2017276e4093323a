"""A browser without a screen and without a network, and the page of a small run with hostile names."""

import base64
import shutil
import subprocess
import tarfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from uwbbench.results import Report
from uwbbench.run import run_experiment
from uwbbench.run.experiment import read_experiment
from uwbbench.show.page import Content, page

FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--window-size=1280,900",
)
HOSTILE = "</script><img src=x onerror=alert(1)>\"'`${1}\n../../etc " + "x" * 10_000

EXPERIMENT = """\
schema: 1
name: {name}
description: {name}
detectors: [paper, cfar-os, "null", {{use: cfar-ca, name: {name}}}]
datasets:
  - {{use: approach, name: {name}, params: {{speed_m_s: 1.2, runs: 2, channel: 9}}}}
  - {{use: approach, name: second, params: {{speed_m_s: 1.2, runs: 2, channel: 5, material: plywood}}}}
scoring: [frame, object]
latency: {{frames: 60}}
intervals: {{resamples: 200}}
stability: false
"""


@pytest.fixture(scope="session")
def report_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Page of a run whose names try to break out of it."""
    import json

    folder = tmp_path_factory.mktemp("page")
    (folder / "small.yaml").write_text(EXPERIMENT.format(name=json.dumps(HOSTILE)))
    run = run_experiment(read_experiment(folder / "small.yaml"), folder / "run", jobs=1)
    (folder / "report.html").write_text(page(Content(Report(run), [folder])), encoding="utf-8")
    return folder / "report.html"


class Browser:
    """Chromium with what the tests ask of it."""

    def __init__(self, driver: Any) -> None:
        self.driver = driver

    def open(self, path: Path, timeout_s: float = 60.0) -> float:
        """Open a page and wait until its charts are drawn; the seconds that took."""
        start = time.monotonic()
        self.driver.get(path.as_uri())
        while self.run("return document.documentElement.dataset.ready") != "yes":
            assert time.monotonic() - start < timeout_s, f"not drawn: {self.errors()}"
            time.sleep(0.02)
        return time.monotonic() - start

    def run(self, script: str, *words: object) -> Any:
        return self.driver.execute_script(script, *words)

    def errors(self) -> list[str]:
        """What the console has said since it was last asked."""
        return [f"{line['level']}: {line['message']}" for line in self.driver.get_log("browser")]

    def choose(self, name: str, value: str) -> None:
        """Choose in a list, as a user does, and wait for the charts."""
        script = "const s = document.getElementById(arguments[0]); s.value = arguments[1];"
        self.run(f"{script} s.dispatchEvent(new Event('change'))", name, value)
        time.sleep(0.6)

    def column(self, head: str) -> list[str]:
        """Texts of a column of the leaderboard, without the marks and the intervals."""
        return self.run(
            "const t = document.getElementById('board');"
            "const i = [...t.tHead.rows[0].cells].findIndex(c => c.textContent === arguments[0]);"
            "const plain = c => { const copy = c.cloneNode(true);"
            "copy.querySelectorAll('small, svg').forEach(e => e.remove()); return copy.textContent; };"
            "return [...t.tBodies[0].rows].map(r => plain(r.cells[i]))",
            head,
        )

    def width(self, pixels: int) -> None:
        self.driver.execute_cdp_cmd(
            "Emulation.setDeviceMetricsOverride",
            {"width": pixels, "height": 900, "deviceScaleFactor": 1, "mobile": pixels < 600},
        )
        time.sleep(0.6)

    def pdf(self) -> bytes:
        printed = self.driver.execute_cdp_cmd("Page.printToPDF", {"paperWidth": 8.27, "paperHeight": 11.69})
        return base64.b64decode(printed["data"])


@pytest.fixture(scope="session")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """Chromium as the distribution has it."""
    webdriver = pytest.importorskip("selenium.webdriver", reason="selenium is not installed")
    binary = shutil.which("chromium") or shutil.which("google-chrome")
    driver = shutil.which("chromedriver")
    if binary is None or driver is None:
        pytest.skip("no Chromium with its driver here (apt-get install chromium chromium-driver)")
    options = webdriver.ChromeOptions()
    options.binary_location = binary
    for flag in (*FLAGS, f"--user-data-dir={tmp_path_factory.mktemp('profile')}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    running = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    try:
        running.execute_cdp_cmd("Network.enable", {})
        running.execute_cdp_cmd(
            "Network.emulateNetworkConditions",
            {"offline": True, "latency": 0, "downloadThroughput": 0, "uploadThroughput": 0},
        )
        yield Browser(running)
    finally:
        running.quit()


@pytest.fixture
def opened(chromium: Browser, report_file: Path) -> Browser:
    """The page, open and drawn."""
    chromium.width(1280)
    chromium.open(report_file)
    return chromium


@pytest.fixture(scope="session")
def axe(tmp_path_factory: pytest.TempPathFactory) -> str:
    """axe-core, as npm has it."""
    npm = shutil.which("npm")
    if npm is None:
        pytest.skip("no npm here, which axe-core comes by")
    folder: Path = tmp_path_factory.mktemp("axe")
    packed = subprocess.run(
        [npm, "pack", "axe-core@4"], cwd=folder, capture_output=True, text=True, timeout=60, check=False
    )
    if packed.returncode != 0:
        pytest.skip("axe-core cannot be fetched")
    with tarfile.open(next(folder.glob("*.tgz"))) as archive:
        member = archive.extractfile("package/axe.min.js")
        assert member is not None
        return member.read().decode()
