"""A whole run in simulation: ir-sim with people in one process, `lcorpp robot` in another."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from lcorpp.learning import save_classifier
from tests.worlds.ros.processes import free_port, wait_for_port

pytestmark = pytest.mark.slow

FOLDER = Path(__file__).parents[2] / "examples" / "robot"


def test_two_decisions_in_the_corridor(parts, tmp_path):
    pytest.importorskip("irsim", reason="needs ir-sim")
    port = free_port()
    text = (FOLDER / "robot.toml").read_text().replace("9090", str(port))
    save_classifier(parts[1]["motion"], tmp_path / "motion.npz")
    config, log = tmp_path / "robot.toml", tmp_path / "robot.jsonl"
    config.write_text(f'{text}\n[classifiers]\nmotion = "motion.npz"\n')
    command = [sys.executable, FOLDER / "simulate.py", "--port", port, "--people", 3, "--seed", 1]
    robot = subprocess.Popen([*map(str, command)], stdout=subprocess.PIPE, text=True)
    try:
        wait_for_port(port)
        program = "from lcorpp.cli.main import main; main()"
        run = [sys.executable, "-c", program, "robot", "--config", config, "--decisions", 2, "--log", log]
        ended = subprocess.run([*map(str, run)], capture_output=True, text=True, timeout=300)
    finally:
        robot.terminate()
        seen = robot.communicate(timeout=30)[0]
    assert ended.returncode == 0, ended.stderr
    decided = re.findall(r"^person (\d+): (interested|not_interested)$", ended.stdout, re.MULTILINE)
    assert decided
    for person, value in decided:
        assert f"person {person}: report_{value}" in seen
    assert len(log.read_text().splitlines()) == len(decided)
