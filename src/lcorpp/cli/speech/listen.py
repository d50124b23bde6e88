"""`lcorpp listen`: hear one answer from the microphone or a wave file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lcorpp.cli import console
from lcorpp.cli.options import common as options
from lcorpp.cli.options.code import take_consent


@take_consent
def listen(
    domain: options.DomainArgument = "intention",
    preset: options.PresetOption = None,
    file: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.wav", help="A recording, PCM or float samples; by default the microphone."
        ),
    ] = None,
    seconds: Annotated[
        float, typer.Option(min=0.1, max=30, help="Seconds of sound after which silence is the answer.")
    ] = 5.0,
    confidence: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.json",
            help="What `lcorpp observe` learnt of the recogniser; by default the domain's `recogniser`.",
        ),
    ] = None,
) -> None:
    """Recognise an answer, and print its observation."""
    from lcorpp.domains import load_domain
    from lcorpp.errors import DomainError
    from lcorpp.worlds.speech import (
        FEATURES,
        Listener,
        Microphone,
        Recogniser,
        WaveSource,
        read_confidence,
    )

    loaded = load_domain(domain, preset=preset)
    learnt = confidence or loaded.planning.recogniser
    if not loaded.planning.utterances or learnt is None:
        missing = "--confidence" if loaded.planning.utterances else "[planning.utterances]"
        raise DomainError(
            f"{loaded.name}: {missing} is missing, or a preset that has it; `lcorpp observe` measures one"
        )
    known = read_confidence(learnt, FEATURES).keep(loaded.pomdp.observations)
    source = Microphone() if file is None else WaveSource.of_file(file)
    listener = Listener(Recogniser(loaded.planning.utterances), known, source)
    if file is None:
        console.print_note(f"listening for at most {seconds:g} seconds")
    heard = listener.listen(seconds)
    console.out.print(f"observation  {heard.observation}")
    console.out.print(f"heard        {heard.text or '(no sentence)'}")
    console.out.print(f"confidence   {heard.confidence:.3f}")
