"""The `lcorpp` command with its subcommands, which load when they are used."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from functools import cache
from importlib import import_module
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

COMMANDS: Mapping[str, str] = {
    "run": "run:run",
    "figures": "figures:figures",
    "explain": "explanation.explain:explain",
    "ask": "ask:ask",
    "fit": "estimation.fit:fit",
    "translate": "ask:translate",
    "solve": "solve:solve",
    "simulate": "simulate:simulate",
    "show": "show:show",
    "learn": "learn:learn",
    "model": "estimation.model:model",
    "play": "page.play:play",
    "export": "page.export:export",
    "robot": "robot.robot:robot",
    "track": "robot.track:track",
    "listen": "speech.listen:listen",
    "observe": "speech.observe:observe",
    "new": "new:new",
    "sweep": "sweep:sweep",
    "replay": "logs.replay:replay",
    "audit": "logs.audit:audit",
    "watch": "logs.watch:watch",
    "check": "check:check",
    "data": "data.commands:app",
}
"""Name -> module in `lcorpp.cli`, and the function or application, in the order of the help."""


class _LoadedCommands(Mapping[str, Any]):
    """Name -> command of typer, which is loaded when it is used."""

    def __getitem__(self, name: str) -> Any:
        return _load_command(name)

    def __iter__(self) -> Iterator[str]:
        return iter(COMMANDS)

    def __len__(self) -> int:
        return len(COMMANDS)


@cache
def _load_command(name: str) -> Any:
    """Import a command; raises `KeyError` if there is none of this name."""
    module, part = COMMANDS[name].split(":")
    found = getattr(import_module(f"lcorpp.cli.{module}"), part)
    if isinstance(found, typer.Typer):
        return typer.main.get_command(found)
    single = typer.Typer(add_completion=False, rich_markup_mode=None)
    single.command(name)(found)
    return typer.main.get_command(single)


class _CommandGroup(TyperGroup):
    """The group of the commands."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.commands: Any = _LoadedCommands()

    def list_commands(self, ctx: object) -> list[str]:
        return list(COMMANDS)


app = typer.Typer(
    name="lcorpp",
    cls=_CommandGroup,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)


def _print_version(requested: bool) -> None:
    if requested:
        from lcorpp import __version__

        typer.echo(f"lcorpp {__version__}")
        raise typer.Exit


@app.callback()
def lcorpp(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit."),
    ] = False,
    verbose: Annotated[
        int,
        typer.Option(
            "--verbose",
            "-v",
            count=True,
            show_default=False,
            help="Before the command: show each decision on standard error; twice (-vv): each step.",
        ),
    ] = 0,
) -> None:
    """Learn, reason and plan: decisions of a robot under uncertainty (LCORPP, AAAI 2020)."""
    if verbose:
        from lcorpp.log_output import show_log  # few commands run with it

        show_log(logging.INFO if verbose == 1 else logging.DEBUG)
