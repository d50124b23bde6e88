from __future__ import annotations

import numpy as np
import pytest

from lcorpp.errors import FileError, ParseError
from lcorpp.planning import flatten, read_pomdp, read_pomdpx
from tests.planning.factored.models import rover
from tests.planning.formats.pomdpx.texts import DIAGRAMS, HEAD, TEXT, parsed


@pytest.mark.parametrize("text", [TEXT, HEAD + DIAGRAMS], ids=["tables", "diagrams"])
def test_one_problem_written_three_ways(text):
    read, own = flatten(parsed(text)), flatten(rover())
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
    assert parsed(turned).equals(parsed(TEXT))


def test_line_ends_and_encodings_do_not_matter():
    plain = parsed(TEXT)
    assert parsed(TEXT.replace("\n", "\r\n")).equals(plain)
    assert parsed(TEXT.encode("latin-1")).equals(plain)
    assert parsed(TEXT.replace("ISO-8859-1", "UTF-16").encode("utf-16")).equals(plain)
    umlaut = TEXT.replace("middle", "Mitte_für_Rover")
    # as bytes in the encoding that the first line tells; as text in none
    assert parsed(umlaut.encode("latin-1")).states[0].values[1] == "Mitte_für_Rover"
    assert parsed(umlaut).states[0].values[1] == "Mitte_für_Rover"


def test_a_word_may_go_over_the_end_of_a_buffer():
    """expat hands out text of ISO-8859-1 in pieces of 1024 bytes."""
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
    read = parsed((problem + functions).encode("latin-1"))
    assert np.flatnonzero(np.asarray(read.start[0])).tolist() == [701]
    damaged = problem.replace(f"{long} 0 1.0 0", f"{long} 0 1.0x 0") + functions
    with pytest.raises(ParseError, match=r"expected a number, found '1\.0x'") as caught:
        parsed(damaged.encode("latin-1"))
    before = damaged[: damaged.index("1.0x")]
    assert caught.value.line == before.count("\n") + 1
    assert caught.value.column == len(before) - before.rfind("\n")


def test_counted_values_have_letters():
    text = TEXT.replace("<ValueEnum>left middle exit</ValueEnum>", "<NumValues>3</NumValues>")
    text = text.replace("left", "s0").replace("middle", "s1").replace("exit", "s2")
    assert parsed(text).states[0].values == ("s0", "s1", "s2")


@pytest.mark.parametrize(
    ("before", "after", "name"),
    [
        ("rover0", "rover1", "rover"),
        ("Rover", "Rover_next", "Rover"),
        ("_0", "_1", "_0"),
        ("rock", "r", "rock"),
    ],
)
def test_names_lose_what_tells_before_from_after(before, after, name):
    text = TEXT.replace("rover_0", before).replace("rover_1", after)
    # where a name would be there twice, the variable keeps its own
    names = [variable.name for variable in parsed(text).states]
    assert names == ([name, "rock"] if name != "rock" else ["rock", "rock_0"])


def test_observed_in_other_spellings():
    for word, observed in (("True", True), ("1", True), ("false", False), ("0", False)):
        text = TEXT.replace('fullyObs="true"', f'fullyObs="{word}"')
        assert parsed(text).states[0].observed == observed


def test_rounding_of_the_file_is_taken_out():
    third = TEXT.replace("0 1.0 0.0", "0.33333 0.33333 0.33333")
    assert flatten(parsed(third)).start.sum() == pytest.approx(1, abs=1e-12)
    with pytest.raises(ParseError, match=r"the row of rover sums to 0\.999, not 1"):
        parsed(TEXT.replace("0 1.0 0.0", "0.333 0.333 0.333"))


def test_a_start_belief_is_optional_where_all_is_seen():
    seen = TEXT.replace('vnameCurr="rock_1"', 'vnameCurr="rock_1" fullyObs="true"')
    belief = seen[seen.index("<InitialStateBelief>") : seen.index("<StateTransitionFunction>")]
    assert set(flatten(parsed(seen.replace(belief, ""))).start) == {1 / 6}
    with pytest.raises(ParseError, match="<pomdpx> needs <InitialStateBelief>"):
        parsed(TEXT.replace(belief, ""))


def test_an_endless_horizon_is_none():
    assert parsed(TEXT.replace("<Variable>", "<Horizon>infinite</Horizon><Variable>")).equals(parsed(TEXT))


def test_a_missing_file():
    with pytest.raises(FileError):
        read_pomdpx("missing.pomdpx")
