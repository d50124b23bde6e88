"""Models and policies by the suffix of their files, and what commands check before they work for long."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.errors import FileError, ModelError, expected_one_of

if TYPE_CHECKING:
    from lcorpp.planning import Factored, Policy, Pomdp
    from lcorpp.planning.policy import Indices

MODELS = (".pomdp", ".pomdpx")
POLICIES = (".policy", ".xml", ".alpha")
PICTURES = (".png", ".svg", ".pdf")
"""Those of `lcorpp.plot_style.SUFFIXES`, which takes long to load."""

ModelArgument = Annotated[Path, typer.Argument(metavar="MODEL", help="A .pomdp or .pomdpx file.")]


def read_model(path: Path) -> tuple[Pomdp, Factored | None]:
    """A model, and its variables where the file tells them."""
    from lcorpp import planning

    if path.suffix.lower() != ".pomdpx":
        return planning.read_pomdp(path), None
    from lcorpp.planning.formats.pomdpx.reader import read_factored

    problem = read_factored(path)
    try:
        return planning.flatten(problem), problem
    except ModelError as error:
        raise ModelError(f"{path}: {error}") from None


def read_policy(path: Path, pomdp: Pomdp, problem: Factored | None = None) -> Policy:
    """A policy for a model: an alpha file by its suffix .alpha, else APPL's XML."""
    from lcorpp import planning

    if path.suffix.lower() == ".alpha":
        return planning.read_alphas(path, pomdp)
    return planning.read_policy(path, pomdp, blocks=None if problem is None else _blocks(problem))


def _blocks(problem: Factored) -> list[Indices]:
    """For each value of the observed variables the states that have it, as APPL's policies number them."""
    import numpy as np

    shape = [len(variable.values) for variable in problem.states]
    seen = [place for place, variable in enumerate(problem.states) if variable.observed]
    states = np.moveaxis(np.arange(np.prod(shape)).reshape(shape), seen, range(len(seen)))
    count = int(np.prod([shape[place] for place in seen], dtype=int))
    return [block.astype(np.intp) for block in states.reshape(count, -1)]


def policy_writer(path: Path) -> Callable[[Policy], None]:
    """What writes a policy to a file: APPL's XML or an alpha file by its suffix, XML where it has none.

    Raises:
        FileError: the suffix is another, or the file could not be written.
    """
    from lcorpp import planning

    suffix = path.suffix.lower()
    if suffix not in ("", *POLICIES):
        raise FileError(f"{path}: not the name of a policy; {expected_one_of(POLICIES)} at its end")
    check_writable(path)
    write = planning.write_alphas if suffix == ".alpha" else planning.write_policy
    return lambda policy: write(policy, path)


def check_writable(path: Path) -> None:
    """Refuse an output that cannot be written, before work is put into it.

    Raises:
        FileError: its folder is missing or closed to the user, or it is a folder itself.
    """
    folder = Path(os.path.realpath(path)).parent
    if path.is_dir():
        reason = "Is a directory"
    elif not folder.is_dir():
        reason = "No such file or directory"
    elif not os.access(folder, os.W_OK):
        reason = "Permission denied"
    else:
        return
    raise FileError(f"{path}: cannot be written: {reason}")


def check_picture(path: Path, *others: str) -> None:
    """Refuse a picture that cannot be written, or another file of one of the suffixes given.

    Raises:
        FileError: the suffix is not that of a picture, or the file could not be written.
    """
    suffixes = (*PICTURES, *others)
    if path.suffix.lower() not in suffixes:
        raise FileError(f"{path}: not a figure file; {expected_one_of(suffixes)} as its suffix")
    check_writable(path)
