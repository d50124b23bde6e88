"""`lcorpp play`: a page on which you are the human."""

from __future__ import annotations

import asyncio
import socket
import webbrowser
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from lcorpp.cli import console
from lcorpp.cli.options import common as options
from lcorpp.cli.options.code import take_consent
from lcorpp.cli.options.groups import take_options
from lcorpp.cli.options.page import PageGroup
from lcorpp.errors import DomainError, FileError

if TYPE_CHECKING:
    from lcorpp.assembly.options import ClassifierOptions
    from lcorpp.domains import Domain, Sense
    from lcorpp.logs.decision_log import DecisionLog
    from lcorpp.values import Dataset
    from lcorpp.web.learning import BatchLearner
    from lcorpp.web.robot import PlayRobot

BATCH = 5
"""Judged trials between two trainings."""


@take_consent
@take_options
def play(
    *,
    domain: options.DomainArgument = "intention",
    preset: options.PresetOption = None,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port; 0 takes any free one.")] = 8000,
    open_page: Annotated[bool, typer.Option("--open/--no-open", help="Open the page in the browser.")] = True,
    batch: Annotated[
        int, typer.Option(min=1, max=10_000, help="Judged trials between two trainings of the classifier.")
    ] = BATCH,
    store: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Keep the judged walks in this store, and learn from those that it has."
        ),
    ] = None,
    page: PageGroup,
    log: options.LogOption = None,
) -> None:
    """Play with the robot in the browser: you are the human.

    You walk, choose what the robot observes, and answer its questions; the page shows what it learns from
    your walk, what it infers, and why it asks. Afterwards you judge the report; after a batch of trials the
    classifier is trained again with your tracks. The page is served to this computer only. Ctrl-C ends it.
    """
    from lcorpp.domains import load_domain
    from lcorpp.logs.decision_log import DecisionLog
    from lcorpp.web.learning import BatchLearner, find_learning_sense, open_store

    require_server()
    loaded = load_domain(domain, preset=preset)
    loaded.check_program_decides("the page")
    page.choose_strategy(loaded)
    chosen = page.choose_classifiers(loaded)
    solver = page.solving.choose_solver(loaded)
    with ExitStack() as stack:
        listening = stack.enter_context(listen(port))
        decisions = None if log is None else stack.enter_context(DecisionLog(log))
        sense = find_learning_sense(loaded, [name for name, own in chosen.items() if own is not None])
        if sense is None and store is not None:
            raise DomainError(f"--store {store}: no classifier of {loaded.name} learns from the page")
        data = None if sense is None else find_initial_data(loaded, sense, chosen[sense.name], page.seed)
        kept = None
        if store is not None and sense is not None and data is not None:
            kept = stack.enter_context(open_store(store, sense, data))
        robot = page.set_up(loaded, chosen, solver)
        host, own_port = listening.getsockname()
        address = f"http://{host}:{own_port}/"

        def show_address() -> None:
            console.out.print(f"{loaded.name} is at {address} for this computer only; Ctrl-C ends it")
            if open_page:
                webbrowser.open(address)

        trials = None
        if sense is not None and data is not None:
            trials = BatchLearner(robot, sense, data, batch_size=batch, store=kept, seed=page.seed)
        try:
            asyncio.run(serve(robot, trials, listening, show_address, decisions, seed=page.seed))
        finally:
            if trials is not None:
                where = f" in {store}" if store else ""
                console.out.print(f"{trials.n_stored} judged trials are kept{where}")


def require_server() -> None:
    """Raise `DomainError` without the packages of the extra `play`."""
    try:
        import starlette  # noqa: F401
        import uvicorn  # noqa: F401
        import websockets  # noqa: F401
    except ImportError as error:
        raise DomainError(
            f"the page needs the package {error.name}: pip install 'lcorpp[play]'; or use `lcorpp export`"
        ) from None


def listen(port: int) -> socket.socket:
    """Return a socket that listens on a port of the loopback.

    Raises:
        FileError: the port is in use or reserved.
    """
    from lcorpp.web.server import HOST

    listening = socket.socket()
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((HOST, port))
        listening.listen(128)
    except OSError as error:
        listening.close()
        raise FileError(
            f"--port {port}: cannot be opened: {error.strerror}; expected a free port, 0 takes any"
        ) from None
    return listening


async def serve(
    robot: PlayRobot,
    learner: BatchLearner | None,
    listening: socket.socket,
    started: Callable[[], None],
    log: DecisionLog | None,
    *,
    seed: int,
) -> None:
    """Serve the page until Ctrl-C. seed: of the draws of LCORPP+limits, with the number of the trial."""
    from lcorpp.web.server import PageServer, make_uvicorn
    from lcorpp.web.service import Service

    append = None if log is None else lambda line: log.append_lines([line])
    loop, trials = asyncio.get_running_loop(), count()

    def make_seed() -> tuple[int, ...]:
        return seed, next(trials)

    def make_service() -> Service:
        if learner is None:
            return Service(lambda: robot, log=append, make_seed=make_seed)
        return Service(lambda: learner.robot, learner.keep, append, make_seed)

    server = PageServer(make_service)

    def notify(message: Mapping[str, Any]) -> None:
        loop.call_soon_threadsafe(server.notify, message)

    if learner is not None:
        learner.notify = notify
    try:
        started()
        await make_uvicorn(server).serve(sockets=[listening])
    finally:
        if learner is not None:
            learner.close()
        server.close()


def find_initial_data(domain: Domain, sense: Sense, source: ClassifierOptions, seed: int) -> Dataset:
    """Return the data that the classifier of a sense was trained on; those of a file are simulated."""
    from lcorpp.assembly.options import TrainingOptions
    from lcorpp.assembly.training_data import make_training_data

    training = source if isinstance(source, TrainingOptions) else TrainingOptions()
    return make_training_data(domain, sense, training, seed).dataset
