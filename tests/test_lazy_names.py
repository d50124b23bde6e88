"""Names that are imported at first use: a missing extra is named."""

import subprocess
import sys

WITHOUT_MATPLOTLIB = """
import sys
sys.modules["matplotlib"] = None  # every import of it fails
from lcorpp.errors import MissingPackageError
for package, name in (("planning", "draw_bounds"), ("learning", "plot_report"), ("logs", "LogWatch")):
    try:
        getattr(__import__("lcorpp." + package, fromlist=["*"]), name)
        print("imported")
    except MissingPackageError as error:
        print(error)
try:
    from lcorpp.learning import plot_tracks
except ImportError as error:
    print(error)
"""


def test_a_plot_without_matplotlib_names_the_extra():
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_MATPLOTLIB], capture_output=True, text=True, check=True, timeout=300
    )
    need = "needs matplotlib, which is not installed: pip install 'lcorpp[plots]'"
    assert done.stdout.splitlines() == [
        f"lcorpp.planning.draw_bounds {need}",
        f"lcorpp.learning.plot_report {need}",
        "imported",
        f"lcorpp.learning.plot_tracks {need}",
    ]
