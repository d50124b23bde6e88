"""A factored POMDP: a robot brings a parcel to a person in one of two rooms, but does not know which.

It observes its own place, and hears the person, best from close by. Each table has a rule, then its
exceptions: `*` is any value, `place` the value before an action and `place'` the value after it.
"""

from lcorpp.planning import Factored, Policy, Pomdp, cpt, flatten, solve, update
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


def show(pomdp: Pomdp, policy: Policy, belief: Belief, depth: int = 0, observed: str = "") -> None:
    """Print the policy's action, and recursively its actions after each likely observation."""
    action = policy.action(belief)
    print(f"{'  ' * depth}{observed}{pomdp.actions[action]}")
    if pomdp.actions[action] == "deliver" or depth == 4:
        return
    reached = pomdp.transition.forward(action, belief)
    for observation, chance in enumerate(pomdp.observation.forward(action, reached)):
        if chance > 0.1:
            name = f"{pomdp.observations[observation]} ({chance:.2f}): "
            show(pomdp, policy, update(pomdp, belief, action, observation), depth + 1, name)


pomdp = flatten(problem, reachable=True)
print(f"{len(pomdp.states)} states, {len(pomdp.observations)} observations, such as {pomdp.observations[0]}")
solution = solve(pomdp)
print(f"value of the policy: at least {solution.lower:.2f}; of any policy: at most {solution.upper:.2f}")
show(pomdp, solution.policy, pomdp.start)
