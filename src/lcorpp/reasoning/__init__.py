"""Evidence to marginal: P-log programs, read, checked and answered exactly.

program = read_plog("knowledge.plog")
reasoner = Enumeration(program)
marginal = reasoner.posterior("intention", {"time": "afternoon", "classifier": "zero"})
"""

from lcorpp.reasoning.classifier_rules import with_classifier
from lcorpp.reasoning.enumeration import Enumeration, ask
from lcorpp.reasoning.parser import parse_plog, parse_query, read_plog
from lcorpp.reasoning.program import Program, program_text
from lcorpp.reasoning.signature import Attribute
from lcorpp.reasoning.syntax import Query
from lcorpp.reasoning.worlds import World

__all__ = [
    "Attribute",
    "Enumeration",
    "Program",
    "Query",
    "World",
    "ask",
    "parse_plog",
    "parse_query",
    "program_text",
    "read_plog",
    "with_classifier",
]
