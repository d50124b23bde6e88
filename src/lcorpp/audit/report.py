"""An audit as text: tables, and a patch of P-log rules to apply by hand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from lcorpp.audit.estimates import Audit, FormTest, ProbabilityEstimate

Table = Sequence[Sequence[str]]


def format_audit(audit: Audit) -> str:
    """Return the tables and the conclusion of an audit."""
    attributes = [
        (x.name, str(x.n_numbers), f"{x.gain:.1f}", f"{x.bic:+.1f}", f"{x.p_value:.2g}")
        for x in audit.attributes
    ]
    parts = [
        f"{audit.n_people} people about whom {audit.strategy} decided{', facts given' * audit.given};"
        f" {audit.program_file}",
        _format_estimates("rule, alone", audit.numbers, {x.name: x.gain for x in audit.numbers}),
        format_table([("attribute, all numbers free", "numbers", "gain", "BIC", "p"), *attributes])
        + f"\np: of {audit.simulations} logs simulated under the knowledge" * bool(audit.simulations),
        _format_estimates("label or answer", audit.rates),
        *([_format_excluded(audit.excluded)] if audit.excluded else []),
        "\n".join(_conclude(audit)),
    ]
    return "\n\n".join(parts)


def _format_estimates(
    title: str, estimates: Sequence[ProbabilityEstimate], gains: Mapping[str, float] = {}
) -> str:
    """Format a table with a column of gains in log likelihood if there are any."""
    rows = [[title, "stated", "suggested", "95 % interval", "p", *(["gain"] if gains else [])]]
    for x in estimates:
        stated, estimate, interval, p_value = "", "", "not determined", ""
        if x.stated is not None:
            stated = f"{x.stated:.3g}"
        if x.interval is not None:
            estimate, interval = f"{x.estimate:.3f}", "{:.3f} to {:.3f}".format(*x.interval)
            p_value = f"{x.p_value:.2g}" if stated else ""
        gain = [f"{gains[x.name]:.1f}"] if gains else []
        rows.append([x.name, stated, estimate, interval, p_value, *gain])
    return format_table(rows)


def _format_excluded(excluded: Mapping[str, int]) -> str:
    rows = [(facts, str(number)) for facts, number in excluded.items()]
    return format_table([("facts of people whom the knowledge excludes", "people"), *rows])


def format_table(rows: Table) -> str:
    """Return rows as aligned columns; the first is aligned at the left."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for first, *others in rows:
        cells = [first.ljust(widths[0])]
        cells += [cell.rjust(width) for cell, width in zip(others, widths[1:], strict=True)]
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines)


def _conclude(audit: Audit) -> list[str]:
    """Return the sentences below the tables."""
    lines = []
    if missing := dict.fromkeys(x.statement.term.name for x in audit.numbers if x.is_missing):
        lines.append(
            f"There are no rules about {', '.join(missing)}: equal probabilities are taken as stated."
        )
    if audit.excluded:
        lines.append(
            f"The knowledge gives probability 0 to {sum(audit.excluded.values())} people of the log."
        )
    if audit.changes:
        lines.append("The data refute the knowledge; the fewest numbers that have to change together:")
        lines += [f"  {x.name}: {_describe_change(x)}" for x in audit.changes]
    else:
        lines.append("The data do not refute the knowledge.")
    if audit.rivals:
        lines.append(_describe_rivals(audit))
    if audit.n_undetermined:
        names = "all numbers"
        if len(audit.undetermined) < len(audit.numbers):
            names = ", ".join(audit.undetermined)
        lines.append(
            f"With {names} free together, {audit.n_undetermined} of their combinations would be undetermined."
        )
    for is_sense, what in ((True, "rates of senses"), (False, "observation model")):
        rates = [x for x in audit.changed_rates if x.is_sense == is_sense]
        if not any(x.is_sense == is_sense for x in audit.rates):
            continue
        if rates:
            lines.append(f"The data refute the {what}:")
            lines += [f"  {x.name}: {_describe_change(x)}" for x in rates]
        else:
            lines.append(f"The data do not refute the {what}.")
    if audit.form is not None:
        lines.append(f"The data refute independent answers (p = {audit.form.p_value:.2g}):")
        lines.append(f"  {_describe_form(audit.form)}")
    elif audit.forms:
        lines.append("The data do not refute answers that are independent given the value.")
    if audit.n_others:
        lines.append(f"{audit.n_others} decisions of other strategies are not used.")
    lines += [f"{number} lines are left out: {reason}" for reason, number in audit.skipped.items()]
    return lines


def _describe_form(form: FormTest) -> str:
    """Return the form of the answers as a sentence."""
    rates = [
        f"{x.rate:.3f}" + ("" if x.interval is None else " ({:.3f} to {:.3f})".format(*x.interval))
        for x in form.wrong
    ]
    if form.name == "number":
        trend = "worse" if form.wrong[-1].rate > form.wrong[0].rate else "better"
        return f"they get {trend} with each question; wrong are, from the first on: {', '.join(rates)}"
    if form.name == "repeated":
        return (
            f"new questions are answered wrongly in {rates[0]}, the same again unlike before in {rates[-1]}"
        )
    shares = [
        f"{100 * x.share:.0f} % of the people with {rate} wrong"
        for x, rate in zip(form.wrong, rates, strict=True)
    ]
    return f"people differ in reliability: {', '.join(shares)}"


def _describe_rivals(audit: Audit) -> str:
    names = "; or of ".join(" and ".join(rival.names) for rival in audit.rivals)
    return f"Not identifiable: other numbers of {names} explain the data as well."


def _describe_change(found: ProbabilityEstimate) -> str:
    assert found.stated is not None
    was = f"{found.stated:.3g}"
    if found.interval is None:
        return f"was {was}; not determined"
    return (
        f"was {was}, suggested {found.estimate:.3f} ({found.interval[0]:.3f} to"
        f" {found.interval[1]:.3f}), p = {found.p_value:.2g}"
    )


def format_patch(audit: Audit) -> str:
    """Return the changed rules, with comments: what they were, intervals, evidence.

    Answers are comments, as their probabilities are in the planner's model.
    """
    lines = [
        f"% Suggested by `lcorpp audit` from {audit.n_people} people; nothing is changed until you do it.",
        f"% Replace these rules of {audit.program_file}.",
    ]
    for x in audit.changes:
        place = "new, as there are no rules" if x.is_missing else f"line {x.statement.at.line}"
        lines += ["", f"% {place}: {_describe_change(x)}"]
        lines.append(f"{x.name} = {x.stated if x.interval is None else x.estimate:.3g}.")
    if not audit.changes:
        lines += ["", "% No number of the knowledge is refuted."]
    if audit.rivals:
        lines += ["", f"% {_describe_rivals(audit)}"]
    for rate in audit.changed_rates:
        source = "" if rate.is_sense else f"{audit.model_file}: "
        lines += ["", f"% {source}{rate.name}: {_describe_change(rate)}"]
        if rate.rule:
            lines.append(f"{rate.rule} = {rate.estimate:.3g}.")
    if audit.form is not None:
        lines += [
            "",
            f"% {audit.model_file}: answers depend on more than the value: {_describe_form(audit.form)}",
        ]
    return "\n".join(lines) + "\n"
