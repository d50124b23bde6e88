"""`lcorpp check`: is this file or folder right?"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.cli import console as show, model_files as models
from lcorpp.errors import DataError, FileError

if TYPE_CHECKING:
    from lcorpp.planning import Pomdp

KINDS = (
    "a .plog, .pomdp, .pomdpx, .policy, .xml or .alpha file, a domain folder or its domain.toml, a folder of"
    " recorded tracks, a store of tracks"
)


def check(
    path: Annotated[Path, typer.Argument(metavar="FILE|FOLDER", help=f"What to check: {KINDS}.")],
    model: Annotated[
        Path | None,
        typer.Option("--model", metavar="MODEL", help="The model that a policy belongs to."),
    ] = None,
) -> None:
    """Check a file or a folder and say what it holds; the first thing that is wrong ends in exit code 2."""
    from lcorpp.domains.loading import SHIPPED_FOLDER, shipped_domains
    from lcorpp.learning.store import is_store

    suffix = path.suffix.lower()
    if path.is_dir() and (path / "interposx.csv").exists():
        _tracks(path)
    elif path.is_dir() or path.name == "domain.toml":
        _domain(path if path.is_dir() else path.parent)
    elif not path.exists() and str(path) in shipped_domains():
        _domain(SHIPPED_FOLDER / path)
    elif is_store(path):
        _store(path)
    elif suffix == ".plog":
        _program(path)
    elif suffix in models.MODELS:
        _model(path)
    elif suffix in models.POLICIES and model is not None:
        _policy(path, model)
    elif suffix in models.POLICIES:
        raise FileError(f"{path}: a policy is checked against its model; give --model FILE.pomdp")
    else:
        raise FileError(f"{path}: cannot tell what this is; expected {KINDS}")


def _tracks(path: Path) -> None:
    from lcorpp.learning import check_trainable, read_authors

    data = read_authors(path, labels={"0": "0", "1": "1"})
    try:
        check_trainable(data)
    except DataError as error:
        raise DataError(f"{path}: {error}") from None
    counts = ", ".join(f"{data.labels.count(label)} of class {label}" for label in sorted(set(data.labels)))
    show.console.print(f"{path}: {len(data)} tracks ({counts}) of {len(set(data.groups))} people: right")
    for note in data.notes:
        show.console.print(f"  note: {note}")


def _store(path: Path) -> None:
    from lcorpp.learning.store import read_store

    store = read_store(path)
    points = f"{store.schema.points} time points of " if store.schema.points else ""
    show.console.print(
        f"{path}: {store.summary()}; {points}{', '.join(store.schema.channels)} every"
        f" {store.schema.interval:g} s{'' if store.damage else ': right'}"
    )
    if store.damage:
        places = "\n".join(f"  {damage}" for damage in store.damage)
        count = f"{len(store.damage)} place{'s' * (len(store.damage) > 1)}"
        raise DataError(f"{path}: damaged in {count}; the other records are right\n{places}")


def _domain(folder: Path) -> None:
    from lcorpp.domains import load_domain
    from lcorpp.domains.toml import preset_names

    for preset in preset_names(folder) or (None,):
        domain = load_domain(folder, preset=preset)
        name = f"{domain.name}, preset {preset}" if preset else domain.name
        show.console.print(
            f"{folder} ({name}): observes {', '.join(domain.observed) or 'nothing'};"
            f" decides {domain.target} among {', '.join(domain.values)}; {_size(domain.pomdp)}: right"
        )


def _program(path: Path) -> None:
    from lcorpp.reasoning import Reasoner, read_plog

    program = read_plog(path)
    worlds = Reasoner(program).count()
    show.console.print(f"{path}: {len(program.attributes)} attributes, {worlds} possible worlds: right")


def _model(path: Path) -> None:
    from lcorpp.planning import read_pomdp

    pomdp = read_pomdp(path)
    show.console.print(f"{path}: {_size(pomdp)}, discount {pomdp.discount:g}: right")


def _size(pomdp: Pomdp) -> str:
    counts = (len(pomdp.states), len(pomdp.actions), len(pomdp.observations))
    return "{} states, {} actions, {} observations".format(*counts)


def _policy(path: Path, model: Path) -> None:
    policy = models.read_policy(path, *models.read_model(model))
    show.console.print(f"{path}: {len(policy)} vectors for {model}: right")
