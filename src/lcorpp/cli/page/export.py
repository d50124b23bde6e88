"""`lcorpp export`: the page of `lcorpp play` as one file that needs no server."""

from __future__ import annotations

import gzip
from pathlib import Path
from typing import Annotated

import typer

from lcorpp.cli import console
from lcorpp.cli.options import common as options
from lcorpp.cli.options.page import choose_page_classifiers, set_up
from lcorpp.cli.options.senses import ClassifiersOption, LearnersOption
from lcorpp.cli.output_files import check_writable


def export(
    to: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder for index.html.")],
    domain: options.DomainArgument = "intention",
    preset: options.PresetOption = None,
    classifier: ClassifiersOption = None,
    learner: LearnersOption = None,
    tracks: options.TracksOption = None,
    epochs: options.EpochsOption = None,
    features: options.FeaturesOption = None,
    rate: options.RateOption = None,
    seed: options.SeedOption = 0,
    jobs: options.JobsOption = None,
    solver: options.SolverOption = None,
    precision: options.PrecisionOption = None,
    time_limit: options.TimeLimitOption = None,
    no_cache: options.NoCacheOption = False,
) -> None:
    """Write the page of `lcorpp play` as one file without a server.

    The file works on any web host, and if it is opened directly. It contains the domain's posteriors, policy
    and classifier, and an engine that decides as the library does; it makes no request. It does not learn
    from the trials, as `lcorpp play` does.
    """
    from lcorpp.domains import load_domain
    from lcorpp.files import make_folder, write_atomically
    from lcorpp.web.export import bundle_page
    from lcorpp.web.model import check_classifiers, check_evidence, make_model
    from lcorpp.web.setup import find_page_folder

    loaded = load_domain(domain, preset=preset)
    chosen = choose_page_classifiers(
        loaded,
        classifiers=classifier,
        learners=learner,
        tracks=tracks,
        epochs=epochs,
        features=features,
        rate=rate,
    )
    check_evidence(loaded)
    check_classifiers(chosen)
    check_writable(make_folder(to) / "index.html")
    limits = options.choose_solver(loaded.planning.solver, solver, precision, time_limit)
    robot = set_up(loaded, chosen, limits, seed=seed, jobs=jobs, no_cache=no_cache)
    with console.show_progress("computing posteriors and reachable beliefs") as _:
        page = bundle_page(find_page_folder(), make_model(robot)).encode()
    write_atomically(to / "index.html", page)
    size = len(gzip.compress(page)) / 1000
    console.out.print(f"wrote {to / 'index.html'}: {len(page) / 1000:.0f} kB, {size:.0f} kB compressed")
