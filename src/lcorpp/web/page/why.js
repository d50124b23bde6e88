// Why this? The values of the best two actions, and what each answer would change.

import { decimal, element, percent, phrase, show } from "./dom.js";

/** Show what a view has to say. domain: of the model. describe: returns a belief's most probable value as elements. */
export function showReasons(domain, view, describe) {
  if (view === null) {
    show("why", element("p", { class: "quiet" }, "Once the robot acts, this compares the expected reward of its best two actions, and what each answer would change."));
    return;
  }
  if (view.action === null) {
    show("why", element("p", {}, "There is nothing left to decide."));
    return;
  }
  show("why", compare(domain, view), ...listOutcomes(domain, view, describe));
}

function compare(domain, view) {
  const chosen = view.values.find((own) => own.action === view.action);
  const other = view.values.find((own) => own.action !== view.action);
  const parts = ["Expected reward: ", element("strong", {}, phrase(domain, chosen.action)), ` ${decimal(chosen.value)}`];
  const gap = other === undefined ? 0 : chosen.value - other.value;
  if (other !== undefined) {
    const size = Math.abs(gap) < 0.005 ? " as much" : ` ${decimal(other.value)}, ${decimal(Math.abs(gap))} ${gap > 0 ? "less" : "more"}`;
    parts.push("; ", element("strong", {}, phrase(domain, other.action)), size);
  }
  if (gap <= -0.005) parts.push(domain.limits === undefined ? ": the policy is an approximation" : ": the plan keeps the limits");
  const why = view.report === null ? ". An answer may change what it does:" : ". Another question would cost more than it could bring.";
  return element("p", {}, ...parts, why);
}

function listOutcomes(domain, view, describe) {
  if (view.outcomes.length === 0) return [];
  const rows = view.outcomes.map((outcome) =>
    element(
      "tr",
      {},
      element("th", { scope: "row" }, phrase(domain, outcome.observation)),
      element("td", { class: "number" }, percent(outcome.probability)),
      element("td", {}, ...describe(outcome.shared)),
      element("td", {}, phrase(domain, outcome.action)),
    ),
  );
  const head = ["if it hears", "chance", "it believes", "and does"].map((text) => element("th", { scope: "col" }, text));
  return [element("table", {}, element("thead", {}, element("tr", {}, ...head)), element("tbody", {}, ...rows))];
}
