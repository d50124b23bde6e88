"""A cache of solutions in a folder, one file for each model, start beliefs, options and state of the code.

A file is the SHA-256 of its content, then the arrays of the solution as .npz: some bytes of a .npz have no
checksum of its own.
"""

from __future__ import annotations

import hashlib
import io
import json
import logging
import os
from collections.abc import Callable
from dataclasses import fields, replace
from functools import cache
from pathlib import Path
from typing import Any
from zipfile import BadZipFile
from zlib import error as ZlibError

import numpy as np

from lcorpp.errors import FileError, LcorppError
from lcorpp.files import hash_files, make_folder, write_atomically
from lcorpp.planning.policy import AlphaVectors, Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.solution import Progress, Solution
from lcorpp.planning.solver_table import ONLINE, SOLVER_NAMES
from lcorpp.planning.solvers import SolverOptions, load_solver
from lcorpp.planning.upper_bounds import MixtureBound, PiecewiseLinearBound, SawtoothBound
from lcorpp.values import Array

LOG = logging.getLogger(__name__)

MAX_BYTES = 2**29
"""Maximum size of the folder; the oldest entries are deleted beyond it."""

DIGEST_SIZE = 32
"""Bytes of a SHA-256."""

_BOUNDS = {kind.__name__: kind for kind in (PiecewiseLinearBound, SawtoothBound, MixtureBound)}
_NUMBERS = ("lower", "upper", "seconds", "reason", "beliefs", "trials", "start_count")
_DAMAGE = (
    *(LcorppError, ValueError, KeyError, TypeError, IndexError, OSError, EOFError, BadZipFile, ZlibError),
    RecursionError,
)
"""What reading a damaged entry may raise."""


def find_cache_folder() -> Path | None:
    """Return the user's folder: $LCORPP_CACHE, else lcorpp in $XDG_CACHE_HOME or ~/.cache.

    Returns:
        None if LCORPP_CACHE is empty: there is no cache.
    """
    given = os.environ.get("LCORPP_CACHE")
    if given is not None:
        return Path(given) if given else None
    home = os.environ.get("XDG_CACHE_HOME")
    return (Path(home) if home else Path.home() / ".cache") / "lcorpp"


def solve_cached(
    pomdp: Pomdp,
    starts: Array,
    options: SolverOptions,
    *,
    mixed: Array | None = None,
    folder: Path | None = None,
    callback: Callable[[Progress], None] | None = None,
) -> Solution:
    """Solve a model, or return the stored solution of an earlier call with the same arguments.

    Solutions of interrupted searches are not stored, nor those of own solvers, whose code may change. A
    damaged entry is computed again; a folder that cannot be written is not used.

    Args:
        starts: (N, S) start beliefs. mixed: (V, S), for SARSOP: as of `lcorpp.planning.sarsop.solve`.
        folder: of the cache; None solves.

    Raises:
        ModelError: as the solver.
    """
    path = None
    if folder is not None and options.name in (*SOLVER_NAMES, ONLINE):
        path = folder / "policies" / f"{_make_key(pomdp, starts, mixed, options)}.solution"
        found = _read(path, pomdp)
        if found is not None:
            return replace(found, solver=options.name)
    solver = load_solver(options.name)
    more = {} if mixed is None else {"mixed": mixed}
    solution = solver(
        pomdp, starts, precision=options.precision, time_limit=options.time_limit, callback=callback, **more
    )
    if path is not None and solution.reason != "interrupted":
        _write(path, solution)
    return replace(solution, solver=options.name)


def _make_key(pomdp: Pomdp, starts: Array, mixed: Array | None, options: SolverOptions) -> str:
    """Return the fingerprint of all that determines a solution."""
    digest = hashlib.sha256(_hash_code().encode())
    options = replace(options, step_seconds=1.0)  # a search at each step begins with the same policy
    beliefs = [starts] if mixed is None else [starts, mixed]
    digest.update(repr((pomdp.fingerprint, options, [each.shape for each in beliefs])).encode())
    for each in beliefs:
        digest.update(np.ascontiguousarray(each, dtype="<f8").tobytes())
    return digest.hexdigest()


@cache
def _hash_code() -> str:
    """Return the fingerprint of this package's code, so that a changed solver solves again."""
    return hash_files(Path(__file__).parent, (".py", ".so", ".pyd"))


def _write(path: Path, solution: Solution) -> None:
    """Write an entry and delete the oldest ones if the folder is too large."""
    upper = solution.policy.upper_bound
    if type(upper).__name__ not in _BOUNDS:
        return
    facts = {name: getattr(solution, name) for name in _NUMBERS}
    facts |= {"bound": type(upper).__name__, "sets": len(solution.policy.vector_sets)}
    arrays: dict[str, Any] = {"history": np.array(solution.history), "start": solution.start}
    arrays |= {f"bound_{f.name}": getattr(upper, f.name) for f in fields(upper)}  # type: ignore[arg-type]
    for number, part in enumerate(solution.policy.vector_sets):
        arrays |= {f"{f.name}_{number}": getattr(part, f.name) for f in fields(part)}
    content = io.BytesIO()
    np.savez(content, facts=np.array(json.dumps(facts)), **arrays)
    try:
        make_folder(path.parent)
        body = content.getvalue()
        write_atomically(path, hashlib.sha256(body).digest() + body)
        _delete_oldest(path.parent)
    except (FileError, OSError) as error:
        LOG.info("the policy is not stored: %s", error)


def _delete_oldest(folder: Path) -> None:
    entries = sorted(((entry.stat().st_mtime, entry) for entry in folder.glob("*.solution")), reverse=True)
    size = 0
    for _, entry in entries:
        size += entry.stat().st_size
        if size > MAX_BYTES:
            entry.unlink(missing_ok=True)


def _read(path: Path, pomdp: Pomdp) -> Solution | None:
    """Read an entry; None if there is none, or it is damaged."""
    if not path.exists():
        return None
    try:
        content = path.read_bytes()
        digest, body = content[:DIGEST_SIZE], content[DIGEST_SIZE:]
        if hashlib.sha256(body).digest() != digest:
            raise ValueError("its checksum differs")
        with np.load(io.BytesIO(body)) as data:
            facts = json.loads(str(data["facts"]))
            sets = [
                AlphaVectors(*(data[f"{field.name}_{number}"] for field in fields(AlphaVectors)))
                for number in range(facts["sets"])
            ]
            kind = _BOUNDS[facts["bound"]]
            # [()] makes a number of an array without dimensions
            bound = kind(*(data[f"bound_{field.name}"][()] for field in fields(kind)))
            history = tuple((s, low, high, int(n)) for s, low, high, n in data["history"].tolist())
            start = data["start"]
        policy = Policy.of_sets(pomdp, sets, bound)
        numbers = {name: facts[name] for name in _NUMBERS}
        return Solution(pomdp, policy, history=history, start=start, cached=True, **numbers)
    except _DAMAGE as error:
        LOG.info("%s: the stored policy is damaged and is computed again: %s", path, error)
        return None
