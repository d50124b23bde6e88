"""Models and policies: read and written in the format that the suffix names."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.cli.output_files import check_writable
from lcorpp.errors import DomainError, FileError, expected_one_of

if TYPE_CHECKING:
    from lcorpp.planning import Factored, Policy, Pomdp
    from lcorpp.values import Indices

MODELS = (".pomdp", ".pomdpx")
POLICIES = (".policy", ".xml", ".alpha")

ModelArgument = Annotated[Path, typer.Argument(metavar="MODEL", help="A .pomdp or .pomdpx file.")]


def read_model(path: Path, preset: str | None = None) -> tuple[Pomdp, Factored | None]:
    """Read a model, with its variables if it has them: a file, or that of a domain (a folder or a name).

    Raises:
        DomainError: the domain is wrong, or a preset is given for a file.
    """
    from lcorpp.domains.loading import list_domains, load_domain
    from lcorpp.planning.formats import model_file

    if path.is_dir() or (not path.exists() and str(path) in list_domains()):
        planning = load_domain(path, preset=preset).planning
        return planning.pomdp, planning.problem
    if preset is not None:
        raise DomainError(f"--preset {preset}: {path} is not a domain")
    return model_file.read_model(path)


def make_model_writer(path: Path) -> Callable[[Pomdp, Factored | None], None]:
    """Return the function that writes a model to `path`, a .pomdp or .pomdpx file.

    Raises:
        FileError: the suffix is unknown, or the file cannot be written.
    """
    from lcorpp import planning

    suffix = path.suffix.lower()
    if suffix not in MODELS:
        raise FileError(f"{path}: not the name of a model; {expected_one_of(MODELS)} at its end")
    check_writable(path)
    if suffix == ".pomdp":
        return lambda pomdp, _: planning.write_pomdp(pomdp, path)
    return lambda pomdp, problem: planning.write_pomdpx(problem or pomdp, path)


def read_policy(path: Path, pomdp: Pomdp, problem: Factored | None = None) -> Policy:
    """Read a policy for a model: an alpha file if the suffix is .alpha, else APPL's XML."""
    from lcorpp import planning

    if path.suffix.lower() == ".alpha":
        return planning.read_alphas(path, pomdp)
    return planning.read_policy(path, pomdp, blocks=None if problem is None else _find_blocks(problem))


def _find_blocks(problem: Factored) -> list[Indices]:
    """Return the states of each joint value of the observed variables, in the order of APPL's policies.

    APPL writes the alpha vectors of one such value together, and over these states only.
    """
    import numpy as np

    shape = [len(variable.values) for variable in problem.states]
    observed = [index for index, variable in enumerate(problem.states) if variable.observed]
    states = np.arange(math.prod(shape), dtype=np.intp).reshape(shape)
    observed_first = np.moveaxis(states, observed, range(len(observed)))
    return list(observed_first.reshape(math.prod(shape[index] for index in observed), -1))


def make_policy_writer(path: Path) -> Callable[[Policy], None]:
    """Return the function that writes a policy to `path`: an alpha file for .alpha, else APPL's XML.

    Raises:
        FileError: the suffix is unknown, or the file cannot be written.
    """
    from lcorpp import planning

    suffix = path.suffix.lower()
    if suffix not in ("", *POLICIES):
        raise FileError(f"{path}: not the name of a policy; {expected_one_of(POLICIES)} at its end")
    check_writable(path)
    write = planning.write_alphas if suffix == ".alpha" else planning.write_policy
    return lambda policy: write(policy, path)
