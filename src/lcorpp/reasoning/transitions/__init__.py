"""Compilation, step 2: turn a ground program into a transition system that decides one component at a time.

`relevance` first leaves out the rules that no query depends on. A component is a set of terms that depend on
each other in a cycle, or (usually) one term. `elimination_tree` arranges the components (`elimination_order`,
`recursion_order`); each step decides the terms of one. `transition_system` shows with an example how
the bodies of rules become the bits of a state, through which steps communicate. `local_distribution`,
`recursive_components` and `stratified` define the outcomes of a step, `transition` their effect on the state;
`linear_recursion` describes recursive components such as reachability, which are decided rule by rule
(`recursion_frontier`, `closure`). `diagram.decision_diagram`
expands the system; `rejection_sampling` samples from it if the program is too large to be compiled.
"""
