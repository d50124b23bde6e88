// What the engine needs besides the page, without a server: the tables of an exported model.

import { Refusal } from "./session.js";

export class ExportedHost {
  /** model: the JSON of `make_exported_model`, lcorpp/web/model.py. */
  constructor(model) {
    this.model = model;
    this.onPush = () => {};
    this.onClose = () => {};
  }

  async start() {
    return this.model;
  }

  async infer(facts, labels) {
    const { domain, posteriors, rules } = this.model;
    const evidence = { ...facts };
    for (const sense of domain.senses) {
      const own = sense.labels.find((label) => label.class === labels[sense.name]);
      if (own !== undefined) evidence[sense.attribute] = own.label;
    }
    const names = [...domain.facts.map((fact) => fact.name), ...domain.senses.map((sense) => sense.attribute)];
    const known = posteriors[names.map((name) => evidence[name] ?? "").join("|")];
    if (known === undefined) throw new Refusal("no possible world satisfies this evidence");
    const entries = (values) => domain.attributes.map((own, i) => [own.name, values[i]]);
    return {
      evidence,
      marginals: Object.fromEntries(entries(known.marginals)),
      shared: known.shared,
      fired: known.fired.map((rule) => rules[rule]),
      world: Object.fromEntries(entries(known.world).filter(([, value]) => value !== null)),
      world_probability: known.world_probability,
    };
  }

  async judge() {
    return { stored: 0, batch: 0 };
  }

  async log() {}
}
