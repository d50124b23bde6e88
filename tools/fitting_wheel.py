"""Print the wheel in a folder that fits this interpreter and these sources; exit 1 if there is none.

`make demo` installs it instead of compiling. A wheel fits if pip would install it here, and contains the
package's files as they are in src/, and kernels of the same sources (`lcorpp/native.sha256`).

Usage: fitting_wheel.py FOLDER
"""

from __future__ import annotations

import hashlib
import sys
import zipfile
from collections.abc import Iterable
from pathlib import Path

# The package `packaging` as a new environment has it.
from pip._vendor.packaging.tags import sys_tags
from pip._vendor.packaging.utils import InvalidWheelFilename, parse_wheel_filename

ROOT = Path(__file__).parents[1]
SUFFIXES = {".so", ".pyd", ".dylib"}  # what is compiled, and so not in src/


def main() -> None:
    for wheel in sorted(Path(sys.argv[1]).glob("lcorpp-*.whl")):
        if is_installable(wheel) and contains_sources(wheel):
            print(wheel)
            return
    sys.exit(1)


def is_installable(wheel: Path) -> bool:
    """Whether pip would install the wheel for this interpreter on this machine."""
    try:
        tags = parse_wheel_filename(wheel.name)[3]
    except InvalidWheelFilename:
        return False
    return not tags.isdisjoint(sys_tags())


def contains_sources(wheel: Path) -> bool:
    """Whether the wheel was built from the files of this checkout."""
    source = ROOT / "src"
    stamp = "lcorpp/native.sha256"
    if not zipfile.is_zipfile(wheel):  # e.g. a copy that was cut off
        return False
    with zipfile.ZipFile(wheel) as archive:
        packed = {
            name for name in archive.namelist() if name.startswith("lcorpp/") and not name.endswith("/")
        }
        if stamp not in packed or archive.read(stamp).decode().strip() != hash_native():
            return False
        packed = {name for name in packed if Path(name).suffix not in SUFFIXES} - {stamp}
        return packed == set(list_names(source)) and all(
            archive.read(name) == (source / name).read_bytes() for name in packed
        )


def list_names(source: Path) -> Iterable[str]:
    """List the files of the package that a wheel contains, relative to its source folder."""
    for path in (source / "lcorpp").rglob("*"):
        if path.is_file() and "__pycache__" not in path.parts and path.suffix not in SUFFIXES:
            yield path.relative_to(source).as_posix()


def hash_native() -> str:
    """Return the hash of the kernels' sources and of how they are built, as CMakeLists.txt computes it."""
    native = (path.relative_to(ROOT).as_posix() for path in (ROOT / "native").rglob("*.?pp"))
    names = sorted([*native, "CMakeLists.txt", "pyproject.toml"])
    hashes = (hashlib.sha256((ROOT / name).read_bytes()).hexdigest() for name in names)
    return hashlib.sha256("".join(hashes).encode()).hexdigest()


if __name__ == "__main__":
    main()
