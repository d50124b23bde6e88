"""Step 2 of compilation: turn a ground program into a transition system that decides one component at a time.

`elimination_order` sorts the components; `rule_groups`, `selection`, `recursive_components` and `stratified`
define the local distribution of each; `transition` and `transition_builder` define its effect on the state.
`transition_system` runs all of this. `circuit.trellis` expands the system to a decision diagram;
`likelihood_weighting` samples from it if it is too large for that.
"""
