"""Problems given by their parts: variables, and how they depend on each other.

model      the problem, `Factored`, and how it becomes a flat one
given      tables in plain words                  cells   how they are put together
table      tables with their zeros left out       variables   the parts of state, action and observation
flat       from variables to one state            joint   tables multiplied out
"""

from __future__ import annotations

from lcorpp.planning.factored.cpt import given
from lcorpp.planning.factored.model import Factored
from lcorpp.planning.factored.table import Table
from lcorpp.planning.factored.variables import Variable

__all__ = ["Factored", "Table", "Variable", "given"]
