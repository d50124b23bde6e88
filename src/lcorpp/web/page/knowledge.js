// What people know: facts as buttons, what follows from them as bars, and the rules that fired.

import { element, percent, readable, show } from "./dom.js";
import { makeBar } from "./bars.js";

const MANY = 6;
const RULE_ORDER = ["shared", "label", "hidden", undefined, "fact"];

export class Knowledge {
  /** domain: of the model. palette: of it. onChoose: takes "facts" or "labels", a name, a value or null. */
  constructor(domain, palette, onChoose) {
    this.palette = palette;
    this.onChoose = onChoose;
    this.openRules = new Set();
    this.setDomain(domain);
  }

  /** Take a description with other priors: the classifier was trained again. */
  setDomain(domain) {
    this.domain = domain;
    this.shared = domain.attributes.filter((own) => own.role === "shared");
    this.hidden = domain.attributes.filter((own) => own.role === "hidden");
    this.seen = domain.attributes.filter((own) => own.role === "fact" || own.role === "label");
  }

  /** Show what follows from evidence. chosen: {facts, labels}. */
  draw(posterior, chosen, isLocked) {
    this.posterior = posterior;
    const focused = document.activeElement?.closest("#reasoning [data-choice]")?.dataset.choice;
    const seen = this.seen.map((own) => this.makeSeen(own, chosen, isLocked));
    const attributes = show("attributes", ...seen, ...[...this.shared, ...this.hidden].map((own) => this.makeInferred(own)));
    attributes.classList.toggle("dense", this.domain.attributes.length > MANY);
    show("rules", ...this.makeRules());
    if (focused) document.querySelector(`[data-choice="${CSS.escape(focused)}"]`)?.focus({ preventScroll: true });
  }

  makeSeen(attribute, chosen, isLocked) {
    const sense = this.domain.senses.find((own) => own.attribute === attribute.name);
    if (sense?.kind === "track") return this.makeGroup(attribute, "the label", {}, sense);
    const [kind, name] = sense ? ["labels", sense.name] : ["facts", attribute.name];
    const choose = (value) => {
      const isPressed = chosen[kind][name] === value;
      return {
        onpress: () => this.onChoose(kind, name, isPressed ? null : value),
        isPressed,
        isDisabled: isLocked,
      };
    };
    return this.makeGroup(attribute, chosen[kind][name] === undefined ? "choose" : "seen", choose);
  }

  makeInferred(attribute) {
    const isShared = attribute.role === "shared";
    return this.makeGroup(attribute, isShared ? "the question" : "hidden");
  }

  makeGroup(attribute, note, choose = {}, sense = null) {
    const isSingle = attribute.role === "shared" && this.domain.shared.length === 1;
    const now = this.posterior.marginals[attribute.name] ?? null;
    const name = readable(attribute.name);
    const title = element("h3", {}, name, element("span", {}, note));
    if (now === null) return element("div", { class: "attribute" }, title, element("p", { class: "quiet" }, "not in all cases"));
    const bars = attribute.values.map((value, k) => {
      const index = isSingle ? this.domain.values.findIndex((own) => own[0] === value) : null;
      const meaning = sense?.labels.find((own) => own.label === value)?.class;
      const mark = sense === null ? index : this.palette.indexOfClass(sense, meaning);
      const bar = makeBar({
        name: value,
        p: now[k],
        prior: attribute.prior?.[k],
        hue: mark === null ? "hue-plain" : this.palette.ofValue(mark),
        mark: this.palette.isColoured ? mark : null,
        ...(typeof choose === "function" ? choose(value) : choose),
      });
      bar.dataset.choice = `${attribute.name}=${value}`;
      return bar;
    });
    return element("div", { class: "attribute", role: "group", "aria-label": `${name}, ${note}` }, title, ...bars);
  }

  makeRules() {
    const { fired, world, world_probability: probability } = this.posterior;
    const hidden = this.hidden.filter((own) => world[own.name] !== undefined);
    const named = [...this.shared, ...hidden].map((own) => nameValue(own.name, world[own.name]));
    const roles = Object.fromEntries(this.domain.attributes.map((own) => [own.name, own.role]));
    const rank = (rule) => RULE_ORDER.indexOf(roles[rule.about]);
    const items = [...fired].sort((a, b) => rank(a) - rank(b)).map((rule) => {
      const key = `${rule.line} ${rule.sentence}`;
      const details = element(
        "details",
        {
          open: this.openRules.has(key),
          ontoggle: () => (details.open ? this.openRules.add(key) : this.openRules.delete(key)),
        },
        element("summary", {}, "why?"),
        element("code", {}, rule.text),
        element("span", { class: "quiet" }, ` line ${rule.line} of the program`),
      );
      return element("li", {}, rule.sentence, " ", details);
    });
    return [
      element("h3", {}, items.length === 1 ? "1 rule at work" : `${items.length} rules at work`, element("span", {}, `likeliest case (${percent(probability)}): ${named.join(", ")}`)),
      items.length === 0
        ? element("p", { class: "quiet" }, "No rule applies.")
        : element("ul", { tabindex: 0, "aria-label": "Rules at work" }, ...items),
    ];
  }
}

function nameValue(attribute, value) {
  if (value === "true") return readable(attribute);
  return value === "false" ? `not ${readable(attribute)}` : readable(value ?? "none");
}
