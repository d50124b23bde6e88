"""Compilation, step 2: turn a ground program into a transition system that decides one component at a time.

`elimination_order` sorts the components. `rule_groups` groups their clauses by structure. `selection`,
`recursive_components` and `stratified` define the local distribution of each component; `transition` and
`transition_builder` define its effect on the state. `transition_system` runs all of this. `circuit.trellis`
expands the system to a decision diagram; `likelihood_weighting` samples from the system if the program is too
large to be compiled.

Terms of this package:

- component: terms that depend on each other in a cycle, or (usually) one term;
- step: the number of a component in the elimination order; step i decides the terms of component i;
- state: the bits that describe the partly decided bodies after a step;
- transition: the possible outcomes of one component and the effect of each on the state;
- rule group: the clauses of a component up to renaming of terms; components with equal structure share it;
- clause group: the clauses of a rule group with the same head;
- bit slot: the index of a bit that a rule group needs; each component has its own bit of the state for it;
- dependents of a step: the rule groups of later components, and of constraints, whose bodies name its terms.
"""
