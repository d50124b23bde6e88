"""`lcorpp show`: the facts of a model, and pictures of what a policy does in it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.cli import model_files as models
from lcorpp.errors import FileError, ModelError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from lcorpp.planning import Factored, Policy, Pomdp

NAMED = 8
"""Up to so many states, actions or observations are named."""


def show_model(
    model: models.ModelArgument,
    policy: Annotated[
        Path | None, typer.Argument(metavar="[POLICY]", help="A .policy, .xml or .alpha file for it.")
    ] = None,
    states: Annotated[
        str | None,
        typer.Option(
            "--states", metavar="A,B[,C]", help="Beliefs over these states are drawn; all of a small model's."
        ),
    ] = None,
    graph: Annotated[
        Path | None,
        typer.Option("--graph", metavar="FILE", help="Also the policy as a graph: .dot or a picture."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="PICTURE", help="Draw what is done where: .png, .svg or .pdf."),
    ] = None,
) -> None:
    """Say what a model holds and, with a policy, draw what is done where in the space of beliefs."""
    for option, given in (("-o", out), ("--graph", graph)):
        if given is not None and policy is None:
            raise FileError(f"{option} draws a policy; give one after {model}")
    if states is not None and out is None:
        raise FileError("--states says what to draw; give a picture with -o")
    if out is not None:
        models.check_picture(out)
    if graph is not None:
        models.check_picture(graph, ".dot")
    pomdp, problem = models.read_model(model)
    if policy is None:
        _facts(model, pomdp, problem)
        return
    drawn = models.read_policy(policy, pomdp, problem)
    chosen = _chosen(pomdp, states) if out is not None else ()
    _facts(model, pomdp, problem)
    _policy_facts(policy, pomdp, drawn)
    if out is not None:
        _draw(pomdp, drawn, chosen, f"{model.name}, {policy.name}", out)
        typer.echo(f"drew {', '.join(chosen)} in {out}")
    if graph is not None:
        _write_graph(pomdp, drawn, f"{model.name}, {policy.name}", graph)


def _facts(model: Path, pomdp: Pomdp, problem: Factored | None) -> None:
    """Sizes, how full the tables are, what an observation leaves open, rewards, discount and start."""
    import numpy as np

    from lcorpp.planning.sarsop.kernels import build_model, load_kernels

    typer.echo(f"{model}")
    if problem is not None:
        parts = (f"{v.name} ({len(v.values)}{', observed' if v.observed else ''})" for v in problem.states)
        _say("variables", ", ".join(parts))
    for kind in ("states", "actions", "observations"):
        names: Sequence[str] = getattr(pomdp, kind)
        _say(kind, f"{len(names)}" + (f": {', '.join(names)}" if len(names) <= NAMED else ""))
    for kind, table in (("T(s' | s, a)", pomdp.transition), ("O(o | a, s')", pomdp.observation)):
        full = len(table.values) / float(np.prod(table.shape, dtype=np.float64))
        _say(kind, f"{len(table.values)} entries above zero, {full:.2%} of the table")
    sizes = np.bincount(build_model(load_kernels(), pomdp).blocks())
    if len(sizes) > 1:
        most = f"of at most {sizes.max()} states" if sizes.max() > 1 else "of one state: all is observed"
        _say("seen at once", f"after each step the belief lies within one of {len(sizes)} blocks {most}")
    _say("reward", f"{pomdp.reward.min():g} to {pomdp.reward.max():g}")
    _say("discount", f"{pomdp.discount:g}")
    _say("start", _start(pomdp))


def _start(pomdp: Pomdp) -> str:
    import numpy as np

    support = np.flatnonzero(pomdp.start)
    if len(support) == 1:
        return f"certainly {pomdp.states[support[0]]}"
    if np.ptp(pomdp.start[support]) < 1e-5:  # files round
        return f"uniform over {'all' if len(support) == len(pomdp.states) else len(support)} states"
    from lcorpp.planning.belief import format_belief

    return format_belief(pomdp, pomdp.start)


def _policy_facts(policy: Path, pomdp: Pomdp, drawn: Policy) -> None:
    used = sorted(set(drawn.actions.tolist()))
    typer.echo(f"{policy}")
    _say(
        "vectors",
        f"{len(drawn)}" + ("" if drawn.covers_all_states else f" in {len(drawn.vector_sets)} sets"),
    )
    names = [pomdp.actions[action] for action in used]
    more = f", ... ({len(names)} in all)" if len(names) > NAMED else ""
    _say("actions", ", ".join(names[:NAMED]) + more)
    value, action = drawn.value_and_action(pomdp.start)
    _say("at the start", f"{pomdp.actions[action]}, which earns at least {value:.6g}")


def _say(name: str, words: str) -> None:
    typer.echo(f"  {name:<13} {words}")


def _chosen(pomdp: Pomdp, states: str | None) -> tuple[str, ...]:
    """The states that a picture is about; semicolons part names that hold commas themselves.

    Raises:
        ModelError: they are unknown, the same, or not two or three.
    """
    if states is None:
        if len(pomdp.states) in (2, 3):
            return pomdp.states
        raise ModelError(
            f"a picture is over two states or three; choose among the {len(pomdp.states)} with --states A,B"
        )
    mark = ";" if any("," in name for name in pomdp.states) else ","
    names = tuple(name.strip() for name in states.split(mark))
    for name in names:
        pomdp.state_index(name)
    if len(names) not in (2, 3) or len(set(names)) < len(names):
        raise ModelError(f"--states {states!r}: a picture is over two states or three that differ")
    return names


def _draw(pomdp: Pomdp, policy: Policy, states: tuple[str, ...], title: str, out: Path) -> None:
    from lcorpp.planning import draw_line, draw_triangle
    from lcorpp.plot_style import save_figure

    draw = draw_line if len(states) == 2 else draw_triangle
    save_figure(draw(pomdp, policy, states, title=title), out)


def _write_graph(pomdp: Pomdp, policy: Policy, title: str, out: Path) -> None:
    """The policy as a graph, for Graphviz or as a picture."""
    from lcorpp.files import write_atomically
    from lcorpp.planning import policy_graph

    graph = policy_graph(pomdp, policy)
    if out.suffix.lower() == ".dot":
        write_atomically(out, graph.to_dot())
    else:
        from lcorpp.planning import draw_graph
        from lcorpp.plot_style import save_figure

        save_figure(draw_graph(graph, title=title), out)
    more = "" if graph.complete.all() else ", and more beyond them"
    typer.echo(f"wrote the policy's graph to {out}: {len(graph)} nodes{more}")
