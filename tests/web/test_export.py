"""The exported page: one file that makes no request, with an engine that runs."""

import base64
import hashlib
import re
from html.parser import HTMLParser

import pytest

from lcorpp.assembly.options import TrainingOptions
from lcorpp.errors import DataError, FileError, TooLargeError
from lcorpp.web import model as web_model
from lcorpp.web.export import bundle_modules, bundle_page
from lcorpp.web.model import check_classifiers, check_evidence, make_exported_model
from lcorpp.web.setup import find_page_folder

INDEX = """<!doctype html>
<html><head>
<title>A page</title>
<link rel="stylesheet" href="style.css">
</head>
<body>
<script type="module" src="main.js"></script>
</body></html>
"""


class Elements(HTMLParser):
    """Collects the attributes of all elements, and the texts of scripts and styles."""

    def __init__(self, text):
        super().__init__()
        self.elements, self.texts, self._inside = [], {"script": [], "style": []}, None
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        self._inside = tag if tag in self.texts else None

    def handle_endtag(self, tag):
        self._inside = None

    def handle_data(self, data):
        if self._inside:
            self.texts[self._inside].append(data)


@pytest.fixture(scope="module")
def page(intention):
    return bundle_page(find_page_folder(), make_exported_model(intention))


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "index.html").write_text(INDEX)
    (tmp_path / "style.css").write_text("body { margin: 0 }\n")
    (tmp_path / "main.js").write_text("export const answer = 42;\n")
    return tmp_path


def test_the_page_names_no_other_file(page):
    for tag, attributes in Elements(page).elements:
        for name in ("src", "href", "srcset", "action", "data", "poster"):
            address = attributes.get(name) or "#"
            assert address.startswith(("#", "data:")), (tag, attributes)
    assert not re.search(r"@import|url\((?!['\"]?(?:data:|#))", page)


def test_the_policy_permits_the_script_and_the_style_alone(page):
    content = Elements(page)
    (policy,) = [
        own["content"]
        for _, own in content.elements
        if own.get("http-equiv", "") == "Content-Security-Policy"
    ]
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    assert rules["default-src"] == "'none'"
    assert "connect-src" not in rules
    for kind in ("script", "style"):
        (text,) = ["".join(content.texts[kind])]
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        assert rules[f"{kind}-src"] == f"'sha256-{digest}'"
        assert sum(tag == kind for tag, _ in content.elements) == 1


def test_the_engine_in_the_script_replies(intention, folder, node):
    (folder / "engine").symlink_to(find_page_folder() / "engine")
    (folder / "main.js").write_text(
        'import { ExportedHost } from "./engine/exported_host.js";\n'
        'import { Session as Engine } from "./engine/session.js";\n'
        "globalThis.session = new Engine(new ExportedHost(globalThis.LCORPP_MODEL));\n"
    )
    script = "".join(Elements(bundle_page(folder, make_exported_model(intention))).texts["script"])
    (folder / "script.js").write_text(script)
    node(script=str(folder / "script.js"))
    assert node(call=["start"])["name"] == "intention"
    node(call=["observe", {"time": "afternoon"}, {}])
    reply = node(call=["decide"])
    prior = intention.parts.robot.reasoner.posterior(intention.domain.shared, {"time": "afternoon"})
    assert reply["shared"] == pytest.approx(list(prior.probabilities))


def test_a_module_is_in_the_script_once(folder):
    (folder / "main.js").write_text('import { a } from "./a.js";\nimport { b } from "./b.js";\na + b;\n')
    (folder / "a.js").write_text('import { b as other } from "./b.js";\nexport const a = other;\n')
    (folder / "b.js").write_text("export const b = 1;\nexport function c() {}\n")
    script = bundle_modules(folder / "main.js")
    assert re.findall(r"^const (module\d)", script, re.MULTILINE) == ["module0", "module1", "module2"]
    assert "const { b: other } = module0;" in script
    assert "return {b, c};" in script
    assert script.count("const b = 1;") == 1


def test_modules_that_import_each_other(folder):
    (folder / "main.js").write_text('import { a } from "./a.js";\n')
    (folder / "a.js").write_text('import { b } from "./b.js";\nexport const a = b;\n')
    (folder / "b.js").write_text('import { a } from "./a.js";\nexport const b = a;\n')
    with pytest.raises(FileError, match=r"a\.js: modules import each other: a\.js -> b\.js -> a\.js"):
        bundle_modules(folder / "main.js")


@pytest.mark.parametrize(
    "line", ["export default 3;", 'import "./a.js";', "export let a = 1;", 'import * as a from "./a.js";']
)
def test_other_ways_to_import_or_export(folder, line):
    (folder / "a.js").write_text("export const a = 1;\n")
    (folder / "main.js").write_text(f"{line}\n")
    with pytest.raises(FileError) as caught:
        bundle_modules(folder / "main.js")
    assert f"main.js: {line!r}; expected `import" in str(caught.value)


def test_a_page_without_the_line_of_its_script(folder):
    (folder / "index.html").write_text(INDEX.replace("main.js", "other.js"))
    with pytest.raises(FileError, match=r"index\.html: expected <script .*main\.js.* once, found 0"):
        bundle_page(folder, {})


@pytest.mark.parametrize("text", ["</script>", "<!-- no -->"])
def test_a_module_that_would_end_the_script(folder, text):
    (folder / "main.js").write_text(f'export const text = "{text}";\n')
    with pytest.raises(FileError, match="contains its own end tag"):
        bundle_page(folder, {})


def test_names_of_a_domain_do_not_end_the_script(folder):
    page = bundle_page(folder, {"description": "</script><script>alert(1)</script>"})
    assert page.count("<script") == 1


def test_a_learner_that_the_page_cannot_run():
    with pytest.raises(DataError, match="cannot run Forest; expected an LSTM"):
        check_classifiers({"motion": TrainingOptions("forest"), "gaze": None})
    check_classifiers({"motion": TrainingOptions("lstm")})


def test_more_evidence_than_a_page_stores(museum, monkeypatch):
    check_evidence(museum.domain)
    monkeypatch.setattr(web_model, "MAX_EVIDENCES", 767)
    with pytest.raises(TooLargeError, match=r"museum: 768 combinations .* expected at most 767"):
        check_evidence(museum.domain)
