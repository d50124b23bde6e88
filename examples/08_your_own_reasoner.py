"""Your own reasoner in place of the domain's program: a table, or a Bayesian network of pyAgrum.

The same from the command line: `lcorpp run --reasoner examples/08_your_own_reasoner.py:Table`, or in
`domain.toml` as `reasoner = "FILE.py:NAME"` in `[reasoning]`.
"""

from pathlib import Path

from lcorpp import load_domain
from lcorpp.domains import with_reasoner
from lcorpp.errors import UndefinedError

PRIORS = {"student": (0.3, 0.15, 0.15), "professor": (0.1, 0.8, 0.1), "visitor": (0.8, 0.1, 0.7)}
"""Identity -> P(interested), P(morning), P(afternoon): the paper's knowledge."""

LIBRARY = {"student": 0.3, "professor": 0.1, "visitor": 0.8}
"""Identity -> P(library)."""

VALUES = ("interested", "not_interested")


class Table:
    """P(intention | time, location) from a table, times P(label | intention)."""

    def __init__(self, program, rates):
        """rates: attribute of a sense -> class -> label -> P(label | class)."""
        self.rates = rates

    def posterior(self, shared, evidence):
        """Return value -> probability; evidence: attribute -> value, or a likelihood of its values."""
        weights = dict.fromkeys(VALUES, 0.0)
        for identity, (interested, morning, afternoon) in PRIORS.items():
            times = {"morning": morning, "afternoon": afternoon, "evening": 1 - morning - afternoon}
            places = {"library": LIBRARY[identity], "classroom": 1 - LIBRARY[identity]}
            p = times.get(evidence.get("time"), 1) * places.get(evidence.get("location"), 1)
            weights["interested"] += p * interested
            weights["not_interested"] += p * (1 - interested)
        for attribute, rates in self.rates.items():
            if attribute in evidence:
                for value in VALUES:
                    weights[value] *= self.weigh(rates[value], evidence[attribute])
        total = sum(weights.values())
        if total == 0:
            raise UndefinedError("the evidence is impossible")
        return {value: weight / total for value, weight in weights.items()}

    def weigh(self, rates, label):
        """Return P(label), or the mean likelihood of the labels (soft evidence)."""
        if isinstance(label, str):
            return rates[label]
        return sum(rates[name] * likelihood for name, likelihood in label)


class Network:
    """A Bayesian network of pyAgrum; it needs `pip install pyagrum`."""

    def __init__(self, program, rates):
        import pyagrum as gum

        names = {name: "{" + "|".join(a.values) + "}" for name, a in program.attributes.items()}
        arcs = (
            "identity->time",
            "identity->location",
            "identity->intention",
            "intention->classifier",
        )
        for name, values in names.items():
            arcs = tuple(arc.replace(name, name + values) for arc in arcs)
        net = gum.fastBN(";".join(arcs))
        net.cpt("identity").fillWith(1).normalizeAsCPT()
        for identity, (interested, morning, afternoon) in PRIORS.items():
            given = {"identity": identity}
            net.cpt("time")[given] = [morning, afternoon, 1 - morning - afternoon]
            net.cpt("location")[given] = [LIBRARY[identity], 1 - LIBRARY[identity]]
            net.cpt("intention")[given] = [interested, 1 - interested]
        self.labels = {name: program.attributes[name].values for name in rates}
        for name, rows in rates.items():
            for value, row in rows.items():
                net.cpt(name)[{"intention": value}] = [row[label] for label in self.labels[name]]
        self.engine = gum.LazyPropagation(net)

    def posterior(self, shared, evidence):
        """Return value -> probability."""
        given = {}
        for name, label in evidence.items():
            weights = None if isinstance(label, str) else dict(label)
            given[name] = label if weights is None else [weights[own] for own in self.labels[name]]
        self.engine.setEvidence(given)
        answer = self.engine.posterior(shared)
        return {value: answer[{shared: value}] for value in VALUES}


def main() -> None:
    domain, evidence = load_domain("intention", preset="paper"), {"time": "afternoon", "classifier": "one"}
    programs = domain.make_reasoner(domain.program)
    print("program:", programs.posterior("intention", evidence))
    for name in ("Table", "Network"):
        own = with_reasoner(domain, f"{Path(__file__)}:{name}")
        print(f"{name}:  ", own.make_reasoner(domain.program).posterior("intention", evidence))


if __name__ == "__main__":
    main()
