"""A problem in parts: a robot brings a parcel to a person who is in one of two rooms, it does not know which.

It always sees where it is; where the person is it can only hear, best from near by. Each table gives a rule,
then its exceptions: `*` is any value, `place` the value before an action and `place'` the one after it.
"""

from lcorpp.planning import Factored, Pomdp, cpt, flatten, solve, update
from lcorpp.planning.policy import Policy
from lcorpp.values import Belief

problem = Factored.of(
    states={"place": "lobby east west done", "person": "east west"},
    observed="place",
    actions="listen go_east go_west deliver",
    observations={"voice": "near far"},
    start={"place": "lobby", "person": {"east": 0.7, "west": 0.3}},
    transition={
        "place": cpt(
            "action place",
            {
                "* *": "same",
                "go_east lobby": {"east": 0.95, "lobby": 0.05},
                "go_west lobby": {"west": 0.95, "lobby": 0.05},
                "go_east west": "lobby",
                "go_west east": "lobby",
                "deliver *": "done",
            },
        ),
        "person": "same",
    },
    observation=cpt(
        "action place' person'",
        {
            "* * *": "far",
            "listen east -": [[0.9, 0.1], [0.2, 0.8]],
            "listen west -": [[0.2, 0.8], [0.9, 0.1]],
        },
    ),
    reward={
        "effort": cpt("action place", {"* *": -1, "* done": 0}),
        "parcel": cpt(
            "action place person",
            {"deliver * *": -20, "deliver east east": 20, "deliver west west": 20, "deliver done *": 0},
        ),
    },
    discount=0.95,
)


def show(pomdp: Pomdp, policy: Policy, belief: Belief, depth: int = 0, seen: str = "") -> None:
    """Print what the policy does, and what it does then after each thing it is likely to see."""
    action = policy.action(belief)
    print(f"{'  ' * depth}{seen}{pomdp.actions[action]}")
    if pomdp.actions[action] == "deliver" or depth == 4:
        return
    reached = pomdp.transition.forward(action, belief)
    for observation, chance in enumerate(pomdp.observation.forward(action, reached)):
        if chance > 0.1:
            then = f"{pomdp.observations[observation]} ({chance:.2f}): "
            show(pomdp, policy, update(pomdp, belief, action, observation), depth + 1, then)


pomdp = flatten(problem, reachable=True)
print(f"{len(pomdp.states)} states, {len(pomdp.observations)} observations, such as {pomdp.observations[0]}")
solution = solve(pomdp)
print(f"the plan earns {solution.lower:.2f}; none earns over {solution.upper:.2f}")
show(pomdp, solution.policy, pomdp.start)
