"""`lcorpp show`: facts of a model, and pictures of a policy."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.cli import model_files, output_files
from lcorpp.cli.console import print_text
from lcorpp.cli.options import common as options
from lcorpp.cli.options.code import take_consent
from lcorpp.errors import FileError, ModelError
from lcorpp.notebook import join_some

if TYPE_CHECKING:
    from collections.abc import Sequence

    from lcorpp.planning import Factored, Policy, Pomdp

MAX_NAMES = 8
"""At most this many states, actions or observations are listed by name."""


@take_consent
def show(
    model: Annotated[
        Path,
        typer.Argument(
            metavar="MODEL",
            help="A .pomdp or .pomdpx file, or a domain: a folder or a shipped domain's name.",
        ),
    ],
    policy: Annotated[
        Path | None, typer.Argument(metavar="[POLICY]", help="A .policy, .xml or .alpha file for it.")
    ] = None,
    states: Annotated[
        str | None,
        typer.Option(
            metavar="A,B[,C]", help="Draw beliefs over these 2 or 3 states; by default all of a small model."
        ),
    ] = None,
    graph: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Draw the policy as a graph: .dot, .png, .svg or .pdf."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="PICTURE",
            help="Draw the policy's action at each belief: .png, .svg or .pdf.",
        ),
    ] = None,
    write: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Write the model, e.g. that of a domain's function: .pomdp, .pomdpx."
        ),
    ] = None,
    preset: options.PresetOption = None,
) -> None:
    """Print facts of a model, write it to a file, or draw a policy.

    The facts are sizes, sparsity, rewards, discount and start belief.
    """
    for option, given in (("-o", out), ("--graph", graph)):
        if given is not None and policy is None:
            raise FileError(f"{option} draws a policy; give one after {model}")
    if states is not None and out is None:
        raise FileError("--states chooses the states of a picture; give one with -o")
    if out is not None:
        output_files.check_figure(out)
    if graph is not None:
        output_files.check_figure(graph, also=[".dot"])
    write_model = None if write is None else model_files.make_model_writer(write)
    pomdp, problem = model_files.read_model(model, preset)
    if write_model is not None:
        write_model(pomdp, problem)
    if policy is None:
        _print_model(model, pomdp, problem)
        if write is not None:
            print_text(f"wrote the model to {write}")
        return
    loaded = model_files.read_policy(policy, pomdp, problem)
    chosen = _select_states(pomdp, states) if out is not None else ()
    _print_model(model, pomdp, problem)
    _print_policy(policy, pomdp, loaded)
    title = f"{model.name}, {policy.name}"
    if out is not None:
        from lcorpp.planning import draw_line, draw_triangle
        from lcorpp.plot_style import save_figure

        draw = draw_line if len(chosen) == 2 else draw_triangle
        save_figure(draw(pomdp, loaded, chosen, title=title), out)
        print_text(f"drew {', '.join(chosen)} in {out}")
    if graph is not None:
        _write_graph(pomdp, loaded, title, graph)
    if write is not None:
        print_text(f"wrote the model to {write}")


def _print_model(model: Path, pomdp: Pomdp, problem: Factored | None) -> None:
    """Print sizes, sparsity of the tables, observable blocks, rewards, discount and start belief."""
    import numpy as np

    from lcorpp.planning.sarsop.kernel_model import build_model

    print_text(f"{model}")
    if problem is not None:
        parts = (f"{v.name} ({len(v.values)}{', observed' if v.observed else ''})" for v in problem.states)
        _print_fact("variables", ", ".join(parts))
    for kind in ("states", "actions", "observations"):
        names: Sequence[str] = getattr(pomdp, kind)
        _print_fact(kind, f"{len(names)}" + (f": {', '.join(names)}" if len(names) <= MAX_NAMES else ""))
    for kind, table in (("T(s' | s, a)", pomdp.transition), ("O(o | a, s')", pomdp.observation)):
        full = len(table.values) / float(np.prod(table.shape, dtype=np.float64))
        _print_fact(kind, f"{len(table.values)} entries above zero, {full:.2%} of the table")
    sizes = np.bincount(build_model(pomdp).export_blocks())
    if len(sizes) > 1:
        size = f"of at most {sizes.max()} states" if sizes.max() > 1 else "of one state: fully observable"
        _print_fact("observable", f"after each step the belief lies within one of {len(sizes)} blocks {size}")
    _print_fact("reward", f"{pomdp.reward.min():g} to {pomdp.reward.max():g}")
    _print_fact("discount", f"{pomdp.discount:g}")
    _print_fact("start", _describe_start(pomdp))


def _describe_start(pomdp: Pomdp) -> str:
    import numpy as np

    support = np.flatnonzero(pomdp.start)
    if len(support) == 1:
        return f"certainly {pomdp.states[support[0]]}"
    if np.ptp(pomdp.start[support]) < 1e-5:  # files round
        return f"uniform over {'all' if len(support) == len(pomdp.states) else len(support)} states"
    from lcorpp.planning.belief import format_belief

    return format_belief(pomdp, pomdp.start)


def _print_policy(policy: Path, pomdp: Pomdp, loaded: Policy) -> None:
    used = sorted(set(loaded.actions.tolist()))
    print_text(f"{policy}")
    sets = "" if loaded.covers_all_states else f" in {len(loaded.vector_sets)} sets"
    _print_fact("vectors", f"{len(loaded)}{sets}")
    _print_fact("actions", join_some([pomdp.actions[action] for action in used], MAX_NAMES))
    value, action = loaded.value_and_action(pomdp.start)
    _print_fact("at the start", f"{pomdp.actions[action]}; lower bound of the value {value:.6g}")


def _print_fact(name: str, text: str) -> None:
    print_text(f"  {name:<13} {text}")


def _select_states(pomdp: Pomdp, states: str | None) -> tuple[str, ...]:
    """Return the states of a picture; semicolons separate names that contain commas.

    Raises:
        ModelError: a state is unknown, or the states are not two or three different ones.
    """
    if states is None:
        if len(pomdp.states) in (2, 3):
            return pomdp.states
        raise ModelError(
            f"a picture has two or three states; choose among the {len(pomdp.states)} with --states A,B"
        )
    separator = ";" if any("," in name for name in pomdp.states) else ","
    names = tuple(name.strip() for name in states.split(separator))
    for name in names:
        pomdp.state_index(name)
    if len(names) not in (2, 3) or len(set(names)) < len(names):
        raise ModelError(f"--states {states!r}: a picture has two or three different states")
    return names


def _write_graph(pomdp: Pomdp, policy: Policy, title: str, out: Path) -> None:
    """Write the policy as a graph, for Graphviz or as a picture."""
    from lcorpp.files import write_atomically
    from lcorpp.planning import policy_graph

    graph = policy_graph(pomdp, policy)
    if out.suffix.lower() == ".dot":
        write_atomically(out, graph.to_dot())
    else:
        from lcorpp.planning import draw_graph
        from lcorpp.plot_style import save_figure

        save_figure(draw_graph(graph, title=title), out)
    more = "" if graph.complete.all() else ", incomplete"
    print_text(f"wrote the policy's graph to {out}: {len(graph)} nodes{more}")
