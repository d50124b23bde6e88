"""The structure of the source: no import cycle, no long file, no crowded folder."""

import ast
import re
import subprocess
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "lcorpp"
MAX_LINES = 500
"""A file is one idea, of 50 to 300 lines as a rule; this is the limit of what is read in one go."""
MAX_FILES = 20


def module_name(path: Path) -> str:
    parts = path.relative_to(SOURCE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports(tree: ast.AST, modules: set[str]) -> set[str]:
    """Return the modules of lcorpp that a file imports, also inside functions and for type checking only."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                submodule = f"{node.module}.{alias.name}"
                found.add(submodule if submodule in modules else node.module)
    return found & modules


def import_graph(source: Path) -> dict[str, set[str]]:
    files = {module_name(path): path for path in sorted(source.rglob("*.py"))}
    return {name: imports(ast.parse(path.read_text()), set(files)) - {name} for name, path in files.items()}


def test_imports_form_no_cycle():
    graph = import_graph(SOURCE)
    assert len(graph) > 200  # the source was found
    try:
        tuple(TopologicalSorter(graph).static_order())
    except CycleError as error:
        pytest.fail("import cycle: " + " -> ".join(error.args[1]))


def test_a_lazy_import_counts():
    tree = ast.parse("def f():\n    from lcorpp.planning import pomdp\n")
    assert imports(tree, {"lcorpp.planning", "lcorpp.planning.pomdp"}) == {"lcorpp.planning.pomdp"}


def test_a_decision_loads_only_what_it_uses():
    """With a noisy channel as the classifier, and a policy that is solved now."""
    code = """import sys, lcorpp
robot = lcorpp.load_robot("intention", cache=False)
facts = {"time": "afternoon", "location": "classroom"}
assert robot.decide(facts, label="zero", world=["pos", "pos", "pos"]).report == "interested"
assert not {"sklearn", "scipy", "torch", "matplotlib", "typer"} & set(sys.modules)
print(*[module.__file__ for name, module in sys.modules.items() if name.split(".")[0] == "lcorpp"])"""
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    files = [Path(file) for file in ended.stdout.split() if file.endswith(".py")]
    assert 10_000 < sum(len(file.read_text().splitlines()) for file in files) < 20_000


@pytest.mark.parametrize("folder", ["src", "native"])
def test_files_are_short_and_folders_small(folder: str):
    files = [path for path in (ROOT / folder).rglob("*") if path.suffix in {".py", ".pyi", ".cpp", ".hpp"}]
    assert files
    long = {str(path.relative_to(ROOT)): len(path.read_text().splitlines()) for path in files}
    assert {name: lines for name, lines in long.items() if lines > MAX_LINES} == {}
    counts = {str(parent.relative_to(ROOT)): 0 for parent in {path.parent for path in files}}
    for path in files:
        counts[str(path.parent.relative_to(ROOT))] += 1
    assert {name: count for name, count in counts.items() if count > MAX_FILES} == {}


@pytest.mark.parametrize("page", ["ARCHITECTURE.md", "CONTRIBUTING.md"])
def test_pages_name_files_that_exist(page: str):
    """Paths in backticks are below the repository or, as in the table of packages, below a package."""
    text = (ROOT / page).read_text()
    paths = [span for span in re.findall(r"`([\w./-]+)`", text) if "/" in span or span.endswith(".py")]
    paths = [path for path in paths if path != "utils.py"]  # a name that the style forbids
    assert len(paths) > 10
    folders = [ROOT, SOURCE, *(path for path in SOURCE.iterdir() if path.is_dir())]
    missing = [path for path in paths if not any((folder / path).exists() for folder in folders)]
    assert missing == []


def test_where_to_look_names_definitions():
    """Names beside a file are defined there, or are keys of domain.toml and commands; not merely imported."""
    section = (ROOT / "ARCHITECTURE.md").read_text().partition("## Where to look")[2].partition("\n## ")[0]
    rows = [line.split("|")[2] for line in section.splitlines() if line.startswith("| ") and "`" in line]
    assert len(rows) >= 16
    named = [pair for row in rows for pair in re.findall(r"`([\w/]+\.py)`: `(\w+(?:\.\w+)?)`", row)]
    named += [pair[::-1] for row in rows for pair in re.findall(r"`(\w+)` in `([\w/]+\.py)`", row)]
    named += [pair[::-1] for row in rows for pair in re.findall(r"`(\w+)` of `\w+` in `([\w/]+\.py)`", row)]
    assert len(named) >= 16
    for file, name in named:
        text, last = (SOURCE / file).read_text(), name.rpartition(".")[2]
        defined = rf"^\s*(?:def|class) {last}\b|^{last}(?:: [^=]+)? = "
        assert last.endswith("_x") or re.search(defined, text, re.MULTILINE), (file, name)
