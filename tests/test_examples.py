"""The examples run without changes and print the documented results."""

import runpy
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"


# Those that guides and tutorials show, too, which are run by tests of their own.
SLOW = {"04_your_own_classifier.py", "05_streaming.py", "07_watch.py"}


@pytest.mark.parametrize(
    "script",
    [
        pytest.param(path, id=path.name, marks=[pytest.mark.slow] if path.name in SLOW else [])
        for path in sorted(EXAMPLES.glob("*.py"))
    ],
)
def test_example_runs(script, monkeypatch, capsys):
    if script.name == "08_your_own_reasoner.py":  # importing pyAgrum crashes where its warnings are errors
        done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=True)
        assert done.stderr == ""
        assert done.stdout.count("interested: 0.8279, not_interested: 0.1721") == 3
        return
    monkeypatch.setattr(sys, "argv", [str(script)])
    runpy.run_path(str(script), run_name="__main__")
    printed = capsys.readouterr()
    assert printed.err == ""
    words = {
        "01_one_decision.py": ("[0.22 0.78 0.   0.   0.  ]", "0.989", "report:    interested"),
        "02_your_own_domain.py": ("tea     0.523", "LCORPP"),
        "03_factored.py": ("8 states, 6 observations", "go_east\n", "voice=near (0.69): deliver"),
        "05_streaming.py": ("10 s: likelihood", "gaps interpolated: 1", "Ada: as the batch to 1e-6: True"),
        "06_recorded_tracks.py": (
            "people.csv:41:3: ",
            "duration      AUC 1.00 LEAK",
            "duration      AUC 0.50",
        ),
        "07_watch.py": ("a second costs 1: watched 0.36 s", "a second costs 10: watched 0.00 s"),
        "04_your_own_classifier.py": ("accuracy:  0.", "hard evidence", "soft evidence"),
    }
    for word in words[script.name]:
        assert word in printed.out


def test_the_posterior_of_the_drinks_computed_by_hand():
    """P(tea) in the morning, looking at the kettle: regulars .1, newcomers 1/3 tea; kettle .7, .1, .25."""
    tea = (0.7 * 0.1 + 0.3 / 3) * 0.7
    coffee = (0.7 * 0.8 + 0.3 / 3) * 0.1
    water = (0.7 * 0.1 + 0.3 / 3) * 0.25
    assert round(tea / (tea + coffee + water), 3) == 0.523


def test_the_readme_s_ten_lines_run():
    readme = (EXAMPLES.parent / "README.md").read_text()
    code = readme.split("```python\n")[1].split("```")[0]
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        input="pos\npos\npos\n",
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.rstrip().endswith("interested")
