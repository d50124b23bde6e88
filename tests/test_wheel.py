"""The wheel in dist/ that fits works in an empty environment, without compiler and repository."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import lcorpp

ROOT = Path(__file__).parents[1]


def find_fitting_wheel(folder: Path) -> str | None:
    command = [sys.executable, str(ROOT / "tools" / "fitting_wheel.py"), str(folder)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert not done.stderr, done.stderr
    return done.stdout.strip() or None


@pytest.mark.slow
def test_a_wheel_needs_no_compiler(tmp_path):
    wheel = find_fitting_wheel(ROOT / "dist")
    if wheel is None:
        pytest.skip("no wheel of these sources in dist/: make wheel")
    variables = {"PATH": "/no-programs", "HOME": str(tmp_path), "CXX": "/no-compiler", "COLUMNS": "100"}
    variables |= {name: os.environ[name] for name in os.environ if name.startswith(("PIP_", "SSL_", "http"))}

    def run(*command: str | Path) -> str:
        done = subprocess.run(
            [str(part) for part in command], cwd=tmp_path, env=variables, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    environment = tmp_path / "environment"
    run(sys.executable, "-m", "venv", environment)
    programs = environment / "bin"
    run(programs / "pip", "install", "--quiet", f"lcorpp[play] @ {Path(wheel).as_uri()}")
    (example,) = re.findall(
        r"One decision in five lines:\n\n```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL
    )
    (tmp_path / "example.py").write_text(example)
    assert run(programs / "python", "example.py").strip() == "interested"
    table = run(programs / "lcorpp", "run", "intention", "--trials", "100", "--learner", "summaries")
    assert re.search(r"LCORPP +.*\d", table)
    with subprocess.Popen(
        [str(programs / "lcorpp"), "play", "--no-open", "--port", "0"],
        cwd=tmp_path,
        env=variables,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as page:
        assert page.stdout is not None
        lines = iter(page.stdout.readline, "")
        assert any("http://127.0.0.1:" in line for line in lines)
        page.send_signal(signal.SIGINT)


def pack(path: Path, *, without: str = "", changed: str = "") -> None:
    """Write a wheel of the sources of this checkout, less a file, or with another content of a file."""
    sys.path.insert(0, str(ROOT / "tools"))
    try:
        import fitting_wheel
    finally:
        sys.path.remove(str(ROOT / "tools"))
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("lcorpp/native.sha256", fitting_wheel.hash_native() + "\n")
        for name in fitting_wheel.list_names(ROOT / "src"):
            if name != without:
                archive.writestr(
                    name, (ROOT / "src" / name).read_bytes() + (b"#" if name == changed else b"")
                )


HERE = f"lcorpp-{lcorpp.__version__}-cp3{sys.version_info[1]}-cp3{sys.version_info[1]}-linux_x86_64.whl"


@pytest.mark.skipif(
    sys.platform != "linux" or os.uname().machine != "x86_64", reason="wheels for x86-64 Linux"
)
def test_make_demo_installs_a_wheel_of_these_sources_only(tmp_path):
    pack(tmp_path / HERE)
    assert find_fitting_wheel(tmp_path) == str(tmp_path / HERE)
    for name in ("without", "changed"):
        folder = tmp_path / name
        folder.mkdir()
        pack(folder / HERE, **{name: "lcorpp/errors.py"})
        assert find_fitting_wheel(folder) is None
    cut = tmp_path / "cut"
    cut.mkdir()
    (cut / HERE).write_bytes((tmp_path / HERE).read_bytes()[:1000])
    assert find_fitting_wheel(cut) is None
    other = tmp_path / "other"
    other.mkdir()
    (tmp_path / HERE).rename(other / f"lcorpp-{lcorpp.__version__}-cp310-cp310-linux_x86_64.whl")
    assert find_fitting_wheel(other) is None


def test_the_version_is_the_same_everywhere():
    assert f"\nversion: {lcorpp.__version__}\n" in (ROOT / "CITATION.cff").read_text()
    assert f"\n## [{lcorpp.__version__}] - " in (ROOT / "CHANGELOG.md").read_text()
