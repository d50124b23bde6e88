"""The page in a browser: three whole trials by mouse and keyboard, and numbers that are the library's."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from lcorpp.learning import StreamingClassifier
from lcorpp.web.export import bundle_page
from lcorpp.web.model import make_exported_model
from lcorpp.web.server import PageServer
from lcorpp.web.service import Service
from lcorpp.web.setup import find_page_folder
from tests.web.conftest import serve

playwright = pytest.importorskip("playwright.sync_api", reason="the page needs Playwright to be played")
CHROMIUM = Path("/usr/bin/chromium")
pytestmark = [
    pytest.mark.skipif(not CHROMIUM.exists(), reason=f"the page needs {CHROMIUM} to be played"),
    pytest.mark.slow,
]
ARGUMENTS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]
PATIENCE = 30_000
"""Milliseconds; nothing is measured, so that a busy computer fails no test."""


@pytest.fixture(scope="module")
def browser():
    with playwright.sync_playwright() as engine:
        opened = engine.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield opened
        opened.close()


@pytest.fixture(scope="module")
def judged():
    return []


@pytest.fixture(scope="module")
def logged():
    return []


@pytest.fixture(scope="module")
def address(intention, judged, logged):
    """A server that keeps judged trials and decisions in lists."""

    def keep(trial):
        judged.append(trial)
        return {"stored": len(judged), "batch": 5}

    with serve(PageServer(lambda: Service(lambda: intention, keep, logged.append))) as port:
        yield f"http://127.0.0.1:{port}/"


class Visit:
    """An open page, and what it sent to the server."""

    def __init__(self, browser, address, **options):
        self.context = browser.new_context(viewport={"width": 1280, "height": 800}, **options)
        self.page = self.context.new_page()
        self.page.set_default_timeout(PATIENCE)
        self.sent, self.complaints = [], []
        self.page.on("websocket", self._listen)
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("console", lambda entry: self.complaints.append(entry.text))
        self.requests = []
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(address)
        self.expect("body").to_have_class(re.compile("ready"), timeout=PATIENCE)

    def _listen(self, connection):
        connection.on("framesent", lambda text: self.sent.append(json.loads(text)))

    def expect(self, selector):
        return playwright.expect(self.page.locator(selector))

    def wait_for_label(self):
        self.expect("#walk-output").to_contain_text("label \u201c", timeout=PATIENCE)

    def wait_for_decision(self):
        """Return the request that logs the decision, once the page has sent it."""
        while not (logs := [request for request in self.sent if request["type"] == "log"]):
            self.page.wait_for_timeout(50)
        return logs[-1]

    def answer_until_report(self, press):
        """Answer with `press(number of the key)` until the robot reports; return the number of answers."""
        for count in range(50):
            title = self.page.locator("#replies h3")
            playwright.expect(title).to_have_text(re.compile("answer|right"), timeout=PATIENCE)
            if "right" in title.inner_text():
                return count
            panels = self.page.locator("#panels > li").count()
            press(1)
            playwright.expect(self.page.locator("#panels > li")).to_have_count(panels + 1, timeout=PATIENCE)
        raise AssertionError("no report")

    def read_marginals(self):
        """Return attribute -> percentages as shown."""
        shown = {}
        for group in self.page.locator("#attributes .attribute").all():
            name = group.get_attribute("aria-label").split(",")[0]
            numbers = group.locator(".bar > span:nth-child(2)").all_inner_texts()
            shown[name] = [float(text.split()[0]) for text in numbers]
        return shown

    def read_beliefs(self):
        """Return the percentages of the table behind the picture, a row a belief."""
        self.page.locator("#belief summary").click()
        rows = self.page.locator("#belief tbody tr").all()
        beliefs = [[float(text.split()[0]) for text in row.locator("td").all_inner_texts()] for row in rows]
        self.page.locator("#belief summary").click()
        return beliefs


@pytest.fixture
def open_page(browser):
    visits = []

    def opened(address, **options):
        visits.append(Visit(browser, address, **options))
        return visits[-1]

    yield opened
    for visit in visits:
        visit.context.close()
    assert [visit.complaints for visit in visits] == [[] for _ in visits]


def percentages(probabilities):
    """Return what three digits and the page's rounding leave of probabilities."""
    return pytest.approx([100 * p for p in probabilities], abs=0.0501)


def check_numbers(visit, robot, facts):
    """Compare what the page shows of a whole trial with the library, from the decision that it logs.

    Returns:
        What was answered, and the decision.
    """
    decision = visit.wait_for_decision()
    assert decision["facts"] == facts
    evidence = robot.domain.evidence(facts, decision["labels"])
    for name, shown in visit.read_marginals().items():
        expected = robot.parts.robot.reasoner.posterior(name, evidence).probabilities
        assert shown == percentages(expected)

    domain, planner = robot.domain, robot.parts.robot.planner
    belief = domain.prior(robot.parts.robot.reasoner.posterior("intention", evidence))
    expected = [domain.marginal(belief).probabilities]
    said = [name for name in re.findall(r"[&#]answers=([^&]*)", visit.page.url)[0].split(",") if name]
    heard = [observation for _, observation in decision["steps"] if observation is not None]
    assert len(heard) == len(said)
    for observation in heard:
        belief = planner.update(belief, planner.action(belief), observation)
        expected.append(domain.marginal(belief).probabilities)
    shown = visit.read_beliefs()
    assert len(shown) == len(expected)
    for own, probabilities in zip(shown, expected, strict=True):
        assert own == percentages(probabilities)
    return said, decision


def check_label(visit, robot, trial):
    """Compare the label that the page shows with that of the library, from the samples of a judged trial."""
    trained = robot.classifiers["motion"]
    streams = StreamingClassifier.from_trained(trained)
    for sample in trial.samples["motion"]:
        streams.push(sample[0], 0, *sample[1:])
    named = streams.classifier(0).classify(np.zeros(1))
    (shown,) = re.findall(r"([\d.]+) %", visit.page.inner_text("#walk-output"))
    p = streams.predictions[0].probabilities[trained.classes.index(named)]
    assert [float(shown)] == percentages([p])


def test_a_trial_by_mouse(open_page, address, intention, judged, logged):
    visit = open_page(address)
    page = visit.page
    stage, person = page.locator("svg.stage").bounding_box(), page.locator(".person").bounding_box()
    page.mouse.move(person["x"] + 10, person["y"] + 5)
    page.mouse.down()
    page.mouse.move(stage["x"] + stage["width"] / 2, stage["y"] + 0.7 * stage["height"], steps=4)
    visit.wait_for_label()
    page.mouse.up()
    page.click("button:has-text('evening')")
    visit.expect("button:has-text('evening')").to_have_attribute("aria-pressed", "true", timeout=PATIENCE)
    page.click("#decide")
    visit.answer_until_report(lambda key: page.click(f"[data-key='{key}']"))
    _, decision = check_numbers(visit, intention, {"time": "evening"})
    report = intention.domain.reported_value(decision["steps"][-1][0])
    page.click("#replies button:has-text('Yes')")
    visit.expect("#kept").to_contain_text("trains again after every 5", timeout=PATIENCE)
    assert judged[-1].truth == report
    check_label(visit, intention, judged[-1])
    line = json.loads(logged[-1])
    assert (line["facts"], line["report"]) == ({"time": "evening"}, report)


def test_a_trial_by_keyboard_that_is_judged_wrong(open_page, address, intention, judged):
    visit = open_page(address)
    page = visit.page
    page.locator("svg.stage").focus()
    page.keyboard.down("ArrowDown")
    visit.wait_for_label()
    page.keyboard.up("ArrowDown")
    page.locator("button.bar", has_text="library").focus()
    page.keyboard.press("Space")
    visit.expect("button.bar:focus").to_have_attribute("aria-pressed", "true", timeout=PATIENCE)
    page.locator("#decide").focus()
    page.keyboard.press("Enter")
    visit.answer_until_report(lambda key: page.keyboard.press(str(key)))
    _, decision = check_numbers(visit, intention, {"location": "library"})
    report = intention.domain.reported_value(decision["steps"][-1][0])
    page.keyboard.press("2")
    visit.expect("#kept").to_contain_text("kept", timeout=PATIENCE)
    assert {judged[-1].truth, report} == {"interested", "not_interested"}
    check_label(visit, intention, judged[-1])


def test_a_prepared_walk_and_its_address(open_page, address, intention, judged):
    visit = open_page(f"{address}#seed=7&fact.location=classroom", reduced_motion="reduce")
    page = visit.page
    page.click("button:has-text('Come')")
    visit.expect("svg.strip").to_have_attribute("aria-valuenow", re.compile(r"1\d\.\d"), timeout=PATIENCE)
    page.click("#decide")
    visit.answer_until_report(lambda key: page.click(f"[data-key='{key}']"))
    said, decision = check_numbers(visit, intention, {"location": "classroom"})
    again = open_page(page.url, reduced_motion="reduce")
    again.expect("#replies h3").to_contain_text("was it right", timeout=PATIENCE)
    said_again, repeated = check_numbers(again, intention, {"location": "classroom"})
    assert (said_again, repeated["steps"]) == (said, decision["steps"])
    assert again.page.url == page.url
    for part in ("#walk-output", "#panels", "#why", "#rules"):
        assert again.page.inner_text(part) == page.inner_text(part)
    page.click("#replies button:has-text('Yes')")
    visit.expect("#kept").to_be_visible(timeout=PATIENCE)
    before = len(judged)
    page.click("#restart")
    visit.expect("#decide").to_be_visible(timeout=PATIENCE)
    assert len(judged) == before


def test_pointing_at_the_path_marks_the_chart(open_page, address):
    visit = open_page(f"{address}#walk=pass", reduced_motion="reduce")
    visit.wait_for_label()
    mark = visit.page.locator(".stage .mark").nth(3).bounding_box()
    visit.page.mouse.move(mark["x"] + 4, mark["y"] + 4)
    visit.expect(".strip .spot").to_have_count(1, timeout=PATIENCE)
    visit.page.locator("svg.strip").focus()
    visit.page.keyboard.press("ArrowUp")
    visit.expect(".stage .spot").to_have_attribute("visibility", "visible", timeout=PATIENCE)


def test_a_walk_by_hand_is_in_the_address(open_page, address, judged):
    visit = open_page(f"{address}#path=300,700,{'gW' * 30}", reduced_motion="reduce")
    visit.page.click("#decide")
    visit.answer_until_report(lambda key: visit.page.click(f"[data-key='{key}']"))
    visit.page.click("#replies button:has-text('Yes')")
    visit.expect("#kept").to_be_visible(timeout=PATIENCE)
    samples = judged[-1].samples["motion"]
    assert samples[:2] == [(0, 3.0, 7.0), (0.1, 3.0, 6.9)]
    assert len(samples) == 31


@pytest.mark.parametrize(
    "fragment",
    [
        "#seed=x&walk=fly&path=1,2,%3Cb%3E",
        "#fact.time=midnight&answers=pos",
        "#fact.__proto__=a&walk=toString",
    ],
)
def test_an_address_that_names_what_is_not_there(open_page, address, fragment):
    visit = open_page(f"{address}{fragment}", reduced_motion="reduce")
    visit.expect("#attributes .attribute").to_have_count(5, timeout=PATIENCE)


def test_the_columns_fit_a_phone(open_page, address):
    visit = open_page(f"{address}#walk=pass&answers=neg", reduced_motion="reduce")
    visit.expect("#panels .panel").not_to_have_count(0, timeout=PATIENCE)
    for width in (390, 800, 1280):
        visit.page.set_viewport_size({"width": width, "height": 800})
        assert visit.page.evaluate("document.documentElement.scrollWidth") == width
    assert visit.page.evaluate("document.documentElement.scrollHeight") == 800


@pytest.mark.parametrize("name", ["intention", "museum"])
def test_the_page_as_one_file(open_page, name, request, tmp_path):
    file = tmp_path / "index.html"
    file.write_text(bundle_page(find_page_folder(), make_exported_model(request.getfixturevalue(name))))
    visit = open_page(f"{file.as_uri()}#seed=3", reduced_motion="reduce")
    if name == "intention":
        visit.page.click("button:has-text('Hesitate')")
        visit.wait_for_label()
    visit.page.click("#decide")
    for _ in range(50):
        visit.expect("#replies h3").to_have_text(re.compile("answer|over"), timeout=PATIENCE)
        if "over" in visit.page.inner_text("#replies h3"):
            break
        panels = visit.page.locator("#panels > li").count()
        visit.page.keyboard.press("1")
        visit.expect("#panels > li").to_have_count(panels + 1, timeout=PATIENCE)
    visit.expect("#replies").to_contain_text("does not learn", timeout=PATIENCE)
    assert all(url.startswith(("file:", "data:")) for url in visit.requests)
