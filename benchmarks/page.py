"""Latency and memory of the server of `lcorpp play`: many people who walk at a time, and malformed messages.

    OMP_NUM_THREADS=1 python benchmarks/page.py [--pages 100] [--seconds 15] [--messages 10000] [--seed 0]

The server is a process of its own on the loopback, the client this one. Each page sends ten samples a second
of a person who walks, and waits for each reply; the pages start at random moments. Then one page sends
messages that are cut, changed or invalid, each of which gets a reply, and begins a trial at the end.
"""

from __future__ import annotations

import asyncio
import json
import random
import re
import subprocess
import sys
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any

import numpy as np
import typer
from websockets.asyncio.client import ClientConnection, connect

PERIOD = 0.1
"""Seconds between two samples of a page."""
MAX_START = 120
"""Lines of the server's output before its address."""
FACTS = {"facts": {"time": "afternoon"}}
GOOD: tuple[dict[str, Any], ...] = (
    {"type": "start"},
    {"type": "infer", "labels": {}, **FACTS},
    {"type": "samples", "sense": "motion", "samples": [[0.0, 1.0, 8.0]]},
    {"type": "judge", "samples": {"motion": [[0.0, 1.0, 8.0]]}, "value": ["unsure"], **FACTS},
    {"type": "log", "labels": {}, "steps": [["greet", "pos"], ["report_interested", None]], **FACTS},
)
"""A message of each type; the value of the judgement is unknown, as the server would train otherwise."""
PARTS: tuple[Any, ...] = (None, -1, 1e999, "", "x" * 5000, [], {}, [[]], "__proto__", "\u0000", True)


def start_server() -> tuple[subprocess.Popen[str], str]:
    """Start `lcorpp play`; return the process and the address of its sessions."""
    command = [str(Path(sys.executable).with_name("lcorpp")), "play", "--no-open", "--port", "0"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert process.stdout is not None
    for _, line in zip(range(MAX_START), process.stdout, strict=False):
        found = re.search(r"http://(\S+)/", line)
        if found:
            return process, f"ws://{found[1]}/session"
    process.kill()
    raise SystemExit("the server did not start")


async def ask(page: ClientConnection, request: dict[str, Any]) -> dict[str, Any]:
    """Send a request and return its reply."""
    await page.send(json.dumps({"id": 1, **request}))
    reply: dict[str, Any] = json.loads(await page.recv())
    return reply


async def walk(address: str, seconds: float, rng: random.Random) -> list[float]:
    """Walk in one page; return the seconds from each sample to its reply."""
    async with connect(address) as page:
        await ask(page, {"type": "start"})
        await asyncio.sleep(rng.uniform(0, PERIOD))
        latencies, next_sample = list[float](), perf_counter()
        for i in range(round(seconds / PERIOD)):
            await asyncio.sleep(max(0.0, next_sample - perf_counter()))
            next_sample += PERIOD
            began = perf_counter()
            sample = [PERIOD * i, rng.gauss(1, 0.02), 9 - 0.05 * i]
            reply = await ask(page, {"type": "samples", "sense": "motion", "samples": [sample]})
            assert reply["type"] == "prediction", reply
            latencies.append(perf_counter() - began)
        return latencies


def spoil(rng: random.Random) -> str | bytes:
    """Return a message with a fault, or a good one out of order."""
    request = {"id": 1, **rng.choice(GOOD)}
    kind = rng.randrange(5)
    if kind == 0:
        request[rng.choice(list(request))] = rng.choice(PARTS)
    if kind == 1:
        request[rng.choice(["facts", "labels", "samples", "value", "steps", "id"])] = rng.choice(PARTS)
    text = json.dumps(request)
    if kind == 2:
        return text[: rng.randrange(len(text))]
    if kind == 3:
        place = rng.randrange(len(text))
        return text[:place] + chr(rng.randrange(1, 300)) + text[place + 1 :]
    return text.encode() if rng.random() < 0.1 else text


async def fuzz(address: str, messages: int, rng: random.Random) -> tuple[int, bool]:
    """Send spoilt messages to one page; return the number of errors replied, and whether a trial follows."""
    async with connect(address, max_size=None) as page:
        errors = 0
        for _ in range(messages):
            await page.send(spoil(rng))
            errors += json.loads(await page.recv())["type"] == "error"
        await ask(page, {"type": "start"})
        reply = await ask(page, {"type": "infer", "labels": {}, **FACTS})
        return errors, reply["type"] == "posterior"


def read_memory(process: subprocess.Popen[str]) -> float:
    """Return the resident memory of a process in MB."""
    status = Path(f"/proc/{process.pid}/status").read_text()
    return int(status.partition("VmRSS:")[2].split()[0]) / 1000


def main(
    pages: Annotated[int, typer.Option(min=1, max=200, help="Pages at a time.")] = 100,
    seconds: Annotated[float, typer.Option(min=1, max=120, help="That each person walks.")] = 15,
    messages: Annotated[int, typer.Option(min=0, max=100_000, help="Malformed messages.")] = 10_000,
    seed: Annotated[int, typer.Option(min=0)] = 0,
) -> None:
    """Print latencies, memory, and what malformed messages do."""
    process, address = start_server()

    async def walk_all() -> list[list[float]]:
        walks = (walk(address, seconds, random.Random(seed + k)) for k in range(pages))
        return list(await asyncio.gather(*walks))

    try:
        asyncio.run(walk(address, 3, random.Random(seed)))  # the first prediction loads modules
        milliseconds = 1000 * np.concatenate(asyncio.run(walk_all()))
        median, late, last = np.percentile(milliseconds, [50, 95, 99])
        print(
            f"{pages} pages, {len(milliseconds)} samples: median {median:.1f} ms, 95 % {late:.1f} ms,"
            f" 99 % {last:.1f} ms, slowest {milliseconds.max():.1f} ms"
        )
        before = read_memory(process)
        errors, plays = asyncio.run(fuzz(address, messages, random.Random(seed)))
        after = read_memory(process)
        print(
            f"{messages} messages, {errors} refused; memory {before:.1f} -> {after:.1f} MB; a trial follows:"
            f" {'yes' if plays else 'no'}"
        )
    finally:
        process.terminate()
        process.wait(10)


if __name__ == "__main__":
    typer.run(main)
