"""`lcorpp export`: the page of `lcorpp play` as one file that needs no server."""

from __future__ import annotations

import gzip
from pathlib import Path
from typing import Annotated

import typer

from lcorpp.cli import console
from lcorpp.cli.options import common as options
from lcorpp.cli.options.code import take_consent
from lcorpp.cli.options.groups import take_options
from lcorpp.cli.options.page import PageGroup
from lcorpp.cli.output_files import check_writable


@take_consent
@take_options
def export(
    *,
    to: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder for index.html.")],
    domain: options.DomainArgument = "intention",
    preset: options.PresetOption = None,
    page: PageGroup,
) -> None:
    """Write the page of `lcorpp play` as one file without a server.

    The file works on any web host, and if it is opened directly. It contains the domain's posteriors, policy
    and classifier, and an engine that decides as the library does; it makes no request. It does not learn
    from the trials, as `lcorpp play` does.
    """
    from lcorpp.domains import load_domain
    from lcorpp.files import make_folder, write_atomically
    from lcorpp.web.export import bundle_page
    from lcorpp.web.model import check_classifiers, check_evidence, make_exported_model
    from lcorpp.web.setup import find_page_folder

    loaded = load_domain(domain, preset=preset)
    page.choose_strategy(loaded)
    chosen = page.choose_classifiers(loaded)
    check_evidence(loaded)
    check_classifiers(chosen)
    check_writable(make_folder(to) / "index.html")
    solver = page.solving.choose_solver(loaded)
    robot = page.set_up(loaded, chosen, solver)
    with console.show_progress("computing posteriors and reachable beliefs") as _:
        html = bundle_page(find_page_folder(), make_exported_model(robot)).encode()
    write_atomically(to / "index.html", html)
    size = len(gzip.compress(html)) / 1000
    console.out.print(f"wrote {to / 'index.html'}: {len(html) / 1000:.0f} kB, {size:.0f} kB compressed")
