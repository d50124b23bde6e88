"""The option --trust-code of the commands that run Python code of a folder."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial, wraps
from inspect import Parameter, Signature, signature
from typing import Annotated, Any

import typer

from lcorpp.cli import console
from lcorpp.user_code import CodeConsent

TrustOption = Annotated[
    bool,
    typer.Option(
        "--trust-code",
        help="Run Python code of a domain folder, robot.toml or log although it belongs to another user.",
    ),
]


def take_consent(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command for typer that runs only code to which the user consents, see `CodeConsent`."""
    own = [
        parameter.replace(kind=Parameter.KEYWORD_ONLY)
        for parameter in signature(command, eval_str=True).parameters.values()
    ]
    trust = Parameter("trust_code", Parameter.KEYWORD_ONLY, default=False, annotation=TrustOption)

    @wraps(command)
    def call(*, trust_code: bool, **values: Any) -> None:
        note = partial(console.print_note, err=True)
        with CodeConsent.of(sys.argv[1:], trust=trust_code, note=note).apply():
            command(**values)

    call.__annotations__ = {parameter.name: parameter.annotation for parameter in (*own, trust)}
    vars(call)["__signature__"] = Signature([*own, trust])
    return call
