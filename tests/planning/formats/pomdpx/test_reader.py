from __future__ import annotations

import numpy as np
import pytest

from lcorpp.errors import FileError, ParseError
from lcorpp.planning import flatten, read_pomdp, read_pomdpx
from tests.planning.factored.models import rover
from tests.planning.formats.pomdpx.texts import DIAGRAMS, HEAD, TEXT, parse


@pytest.mark.parametrize("text", [TEXT, HEAD + DIAGRAMS], ids=["tables", "diagrams"])
def test_one_problem_written_three_ways(text):
    read, own = flatten(parse(text)), flatten(rover())
    assert read.fingerprint == own.fingerprint
    assert (read.start == own.start).all()


def test_xml_is_read_under_any_name(tmp_path):
    """sarsop for R publishes one as .pomdp."""
    file = tmp_path / "rover.pomdp"
    file.write_text("\n" + TEXT[TEXT.index("<pomdpx") :])
    assert read_pomdp(file).fingerprint == flatten(rover()).fingerprint


def test_functions_may_come_before_variables():
    variables = HEAD[HEAD.index("<Variable>") :]
    turned = TEXT.replace(variables, "").replace("</pomdpx>", variables + "</pomdpx>")
    assert parse(turned).equals(parse(TEXT))


def test_line_ends_and_encodings_do_not_matter():
    plain = parse(TEXT)
    assert parse(TEXT.replace("\n", "\r\n")).equals(plain)
    assert parse(TEXT.encode("latin-1")).equals(plain)
    assert parse(TEXT.replace("ISO-8859-1", "UTF-16").encode("utf-16")).equals(plain)
    umlaut = TEXT.replace("middle", "Mitte_für_Rover")
    # as bytes in the declared encoding; as text in none
    assert parse(umlaut.encode("latin-1")).states[0].values[1] == "Mitte_für_Rover"
    assert parse(umlaut).states[0].values[1] == "Mitte_für_Rover"


def test_a_word_across_the_end_of_a_buffer():
    """expat passes ISO-8859-1 text in pieces of 1024 bytes."""
    long = "0.0 " * 700
    problem = TEXT.replace("left middle exit", " ".join(f"s{i}" for i in range(703)))
    problem = problem[: problem.index("<StateTransitionFunction>")].replace("0 1.0 0.0", f"{long} 0 1.0 0")
    functions = """<StateTransitionFunction>
      <CondProb><Var>rover_1</Var><Parent>rover_0</Parent><Parameter>
        <Entry><Instance>- -</Instance><ProbTable>identity</ProbTable></Entry></Parameter></CondProb>
      <CondProb><Var>rock_1</Var><Parent>rock_0</Parent><Parameter>
        <Entry><Instance>- -</Instance><ProbTable>identity</ProbTable></Entry></Parameter></CondProb>
    </StateTransitionFunction><ObsFunction>
      <CondProb><Var>sensor</Var><Parent>null</Parent><Parameter>
        <Entry><Instance>-</Instance><ProbTable>1 0</ProbTable></Entry></Parameter></CondProb>
    </ObsFunction><RewardFunction>
      <Func><Var>moving</Var><Parent>null</Parent><Parameter/></Func>
      <Func><Var>sampling</Var><Parent>null</Parent><Parameter/></Func>
    </RewardFunction></pomdpx>"""
    read = parse((problem + functions).encode("latin-1"))
    assert np.flatnonzero(np.asarray(read.start[0])).tolist() == [701]
    damaged = problem.replace(f"{long} 0 1.0 0", f"{long} 0 1.0x 0") + functions
    with pytest.raises(ParseError, match=r"expected a number, found '1\.0x'") as caught:
        parse(damaged.encode("latin-1"))
    before = damaged[: damaged.index("1.0x")]
    assert caught.value.line == before.count("\n") + 1
    assert caught.value.column == len(before) - before.rfind("\n")


def test_counted_values_have_letters():
    text = TEXT.replace("<ValueEnum>left middle exit</ValueEnum>", "<NumValues>3</NumValues>")
    text = text.replace("left", "s0").replace("middle", "s1").replace("exit", "s2")
    assert parse(text).states[0].values == ("s0", "s1", "s2")


@pytest.mark.parametrize(
    ("before", "after", "name"),
    [
        ("rover0", "rover1", "rover"),
        ("Rover", "Rover_next", "Rover"),
        ("_0", "_1", "_0"),
        ("rock", "r", "rock"),
    ],
)
def test_names_lose_the_suffixes_of_before_and_after(before, after, name):
    text = TEXT.replace("rover_0", before).replace("rover_1", after)
    # an ambiguous name stays as in the file
    names = [variable.name for variable in parse(text).states]
    assert names == ([name, "rock"] if name != "rock" else ["rock", "rock_0"])


def test_observed_in_other_spellings():
    for word, observed in (("True", True), ("1", True), ("false", False), ("0", False)):
        text = TEXT.replace('fullyObs="true"', f'fullyObs="{word}"')
        assert parse(text).states[0].observed == observed


def test_rounding_errors_are_removed():
    third = TEXT.replace("0 1.0 0.0", "0.33333 0.33333 0.33333")
    assert flatten(parse(third)).start.sum() == pytest.approx(1, abs=1e-12)
    with pytest.raises(ParseError, match=r"the row of rover sums to 0\.999, not 1"):
        parse(TEXT.replace("0 1.0 0.0", "0.333 0.333 0.333"))


def test_a_start_belief_is_optional_if_all_is_observed():
    seen = TEXT.replace('vnameCurr="rock_1"', 'vnameCurr="rock_1" fullyObs="true"')
    belief = seen[seen.index("<InitialStateBelief>") : seen.index("<StateTransitionFunction>")]
    assert set(flatten(parse(seen.replace(belief, ""))).start) == {1 / 6}
    with pytest.raises(ParseError, match="<pomdpx> needs <InitialStateBelief>"):
        parse(TEXT.replace(belief, ""))


def test_an_infinite_horizon_is_accepted():
    assert parse(TEXT.replace("<Variable>", "<Horizon>infinite</Horizon><Variable>")).equals(parse(TEXT))


def test_a_missing_file():
    with pytest.raises(FileError):
        read_pomdpx("missing.pomdpx")
