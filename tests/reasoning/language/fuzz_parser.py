"""Fuzz the parser with atheris: each input must give a program or a typed error within a second.

    python tests/reasoning/language/fuzz_parser.py -runs=1000000

Other options are libFuzzer's. An input is text, or, after the byte 255, one token for each byte. Without
atheris (`pip install atheris`) it prints a note and exits.
"""

from __future__ import annotations

import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

try:
    import atheris
except ImportError:
    print("skipped: atheris is not installed; `pip install atheris` brings it")
    raise SystemExit(0) from None

with atheris.instrument_imports(include=["lcorpp.reasoning"]):
    from lcorpp.errors import LcorppError
    from lcorpp.reasoning.language.parser import parse_plog, parse_query

LONGEST = 1.0
"""Maximal CPU seconds for one input."""

WORDS = """
s a b p q f X Y _ 0 1 2 7 2.5 99999 2147483648 .. . , : ; :- :+ +- = == != <> < <= > >= ( ) { } [ ] | & ! ? -
+ * / \\ -> # #s #t #n #boolean #domain #const #semantics 2018 2009 not random pr obs do mod and or sorts
attributes statements boolean true false % %* *%"""

STATEMENTS = """s={a,b}.
n={0..3}.
#t=f(#s,#n).
p:boolean.
f:s->n.
#domain n(X;Y), s(Z).
random(p).
random(f(Z)).
random(f(Z):{X:X>1}):-p.
pr(f(a)=1|p)=1/2.
p:-f(a)=X,X>Y,f(b)=Y.
obs(f(a),1,false).
do(p).
?{p,f(a)=1}|obs(p),do(f(b)=2).
[r(Z)]"""

TOKENS = [*WORDS.split(), *STATEMENTS.split("\n"), "\n"]

PROGRAM = parse_plog("s={a,b}. n={0..3}. p:boolean. f:s->n. random(p). random(f(X)).")


def text_of(data: bytes) -> str:
    """Decode bytes to a text."""
    if data[:1] == b"\xff":
        return " ".join(TOKENS[byte % len(TOKENS)] for byte in data[1:])
    return data.decode("utf-8", errors="replace")


def one_input(data: bytes) -> None:
    """Parse one input as a program and as a query."""
    text = text_of(data)
    start = time.process_time()
    with suppress(LcorppError):
        parse_plog(text)
    with suppress(LcorppError):
        parse_query(text, PROGRAM)
    seconds = time.process_time() - start
    if seconds > LONGEST:
        raise TimeoutError(f"{seconds:.2f} s for {len(text)} characters: {text[:200]!r}")


def main() -> None:
    """Fuzz, beginning with the programs of tests/plog."""
    with tempfile.TemporaryDirectory() as folder:
        words = Path(folder) / "dictionary"
        escaped = (token.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\x0a") for token in TOKENS)
        words.write_text("".join(f'"{token}"\n' for token in escaped))
        seeds = Path(folder) / "seeds"
        seeds.mkdir()
        for number, path in enumerate(sorted((Path(__file__).parents[2] / "plog").glob("*.plog"))):
            for part, statement in enumerate(path.read_text().split("\n")):
                (seeds / f"{number}-{part}").write_text(statement)
        for number in range(len(TOKENS)):
            (seeds / f"tokens-{number}").write_bytes(bytes([255, *range(number, number + 8)]))
        options = [f"-dict={words}", "-max_len=300", "-timeout=60", "-print_final_stats=1", str(seeds)]
        atheris.Setup([sys.argv[0], *options, *sys.argv[1:]], one_input)
        atheris.Fuzz()


if __name__ == "__main__":
    main()
