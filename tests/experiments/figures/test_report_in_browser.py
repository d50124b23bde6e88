"""The report in a real browser: Debian's chromium, without a window; skipped where it is not installed."""

import json
import re
import shutil
import subprocess
from html import unescape

import pytest

from lcorpp.assembly.progress import no_progress
from lcorpp.experiments.figures import running
from lcorpp.experiments.figures.registry import FIGURES
from lcorpp.experiments.figures.result import FigureOptions
from lcorpp.experiments.figures.running import FigureRun

CHROMIUM = shutil.which("chromium")
pytestmark = [
    pytest.mark.slow,  # the fast suite has the elements of the report: test_running.py
    pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed"),
]

OPTIONS = ("--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking")

MEASURE = """
<pre id="found"></pre>
<script>
function look(frame) {
  const page = frame.contentDocument, root = page.documentElement;
  const shown = [...page.querySelectorAll(".picture")].filter(picture => picture.offsetParent !== null);
  const box = element => element.getBoundingClientRect();
  return {
    width: root.scrollWidth,
    pictures: shown.map(picture => picture.className.split(" ")[1]),
    svg: shown.map(picture => box(picture.querySelector("svg"))).map(svg => [svg.width, svg.height]),
    wide: [...page.querySelectorAll("h1, h2, h3, p, li, .scroll, .picture")].map(e => box(e).right),
    font: parseFloat(frame.contentWindow.getComputedStyle(page.body).fontSize),
    requests: frame.contentWindow.performance.getEntriesByType("resource").map(entry => entry.name),
  };
}
window.onload = () => {
  const frames = [...document.querySelectorAll("iframe")];
  document.getElementById("found").textContent = JSON.stringify(frames.map(look));
};
</script>
"""


def browse(*arguments, folder):
    profile = f"--user-data-dir={folder / 'profile'}"
    return subprocess.run(
        [CHROMIUM, *OPTIONS, profile, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    ).stdout


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """The report of two figures that are quick to make; the second has a wide table."""
    folder = tmp_path_factory.mktemp("figures")
    options = FigureOptions(fast=True, trials=100)
    assert running.FIGURES is FIGURES
    assert len(list(FigureRun(folder, ["strategies", "trial"], options).make(no_progress))) == 2
    return folder / "report.html"


def test_the_report_fits_a_phone_and_a_desk(report, tmp_path):
    frames = "".join(
        f'<iframe src="{report.as_uri()}" style="width:{w}px;height:900px"></iframe>' for w in (390, 1100)
    )
    (tmp_path / "page.html").write_text(frames.replace("style=", 'frameborder="0" style=') + MEASURE)
    dom = browse(
        "--allow-file-access-from-files", "--dump-dom", (tmp_path / "page.html").as_uri(), folder=tmp_path
    )
    phone, desk = json.loads(unescape(re.search(r'<pre id="found">(.*?)</pre>', dom, re.DOTALL)[1]))
    assert phone["pictures"] == ["column"] * 2
    assert desk["pictures"] == ["wide"] * 2
    assert phone["width"] <= 390  # nothing but tables scrolls sideways
    assert max(phone["wide"]) <= 390
    assert max(desk["wide"]) <= 1100
    assert all(width > 320 and height > 300 for width, height in phone["svg"])
    assert all(width > 800 and height > 300 for width, height in desk["svg"])
    assert phone["font"] == desk["font"] == 16
    assert phone["requests"] == desk["requests"] == []


def test_the_report_can_be_printed(report, tmp_path):
    browse(f"--print-to-pdf={tmp_path / 'report.pdf'}", report.as_uri(), folder=tmp_path)
    content = (tmp_path / "report.pdf").read_bytes()
    assert content.startswith(b"%PDF")
    assert 2 <= len(re.findall(rb"/Type /Page\b", content)) <= 8


def test_the_pictures_are_seen(report, tmp_path):
    """A screenshot has the blue and orange of the bars: the inline SVG is drawn."""
    from matplotlib.image import imread

    browse(
        f"--screenshot={tmp_path / 'shot.png'}", "--window-size=1100,900", report.as_uri(), folder=tmp_path
    )
    pixels = (imread(tmp_path / "shot.png")[:, :, :3] * 255).round().astype(int)
    for colour in ((0x2F, 0x6D, 0xB5), (0xD9, 0x82, 0x2B)):
        assert (abs(pixels - colour).max(axis=2) <= 3).sum() > 1000
