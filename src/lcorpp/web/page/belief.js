// The belief: a bead under the fan for two values, in the triangle for three, bars otherwise.

import { element, percent, phrase, readable, show, tableOf } from "./dom.js";
import { drawFan } from "./fan.js";
import { drawTriangle } from "./triangle.js";
import { makeBar } from "./bars.js";
import { makeKey } from "./marks.js";

const MAX_BARS = 9;
const CAPTIONS = {
  2: "Each line is a plan. The robot follows the highest one above its belief, the large dot. Numbered dots: beliefs after that many answers.",
  3: "A corner is certainty. The colour around the belief, the large dot, is what the robot does next. Numbered dots: beliefs after that many answers.",
};

const LIMITED = "The picture is that of the best policy without limits; the robot follows a drawn plan that keeps them.";

export class BeliefPicture {
  /** domain: of the model. palette: of it. */
  constructor(domain, palette) {
    this.domain = domain;
    this.palette = palette;
    this.reset();
  }

  reset() {
    this.beliefs = [];
  }

  /** Show the belief before the robot acts: it replaces the one before. */
  preview(shared, fan) {
    this.beliefs = [shared];
    this.draw(fan);
  }

  /** Show a belief after those before. */
  add(shared, fan) {
    this.beliefs.push(shared);
    this.draw(fan);
  }

  draw(fan) {
    const { domain, palette, beliefs } = this;
    const count = domain.values.length;
    this.fan = fan ?? this.fan ?? null;
    const hasPlans = this.fan !== null && this.fan.length > 0;
    let picture = null;
    if (hasPlans && count === 2) picture = drawFan(this.fan, beliefs.map((shared) => shared[0]), domain, palette);
    if (hasPlans && count === 3) picture = drawTriangle(this.fan, beliefs, domain, palette);
    if (picture === null) show("belief", ...this.makeBars());
    else show("belief", picture, this.makeKeys(), element("p", { class: "quiet" }, domain.limits === undefined ? CAPTIONS[count] : LIMITED), this.makeTable());
  }

  makeKeys() {
    const actions = [...new Set(this.fan.map((own) => own.action))];
    const keys = actions.map((action) => element("li", {}, element("i", { class: this.palette.ofAction(action) }), phrase(this.domain, action)));
    return element("ul", { class: "keys", "aria-label": "Best action by region" }, ...keys);
  }

  makeTable() {
    const head = ["after", ...this.domain.values.map(readable)];
    const rows = this.beliefs.map((shared, i) => [i === 0 ? "reasoning" : `answer ${i}`, ...shared.map(percent)]);
    return tableOf("Belief as a table", head, rows);
  }

  makeBars() {
    const now = this.beliefs.at(-1);
    const before = this.beliefs.at(-2);
    const order = now.map((_, k) => k).sort((a, b) => now[b] - now[a] || a - b);
    const { isColoured } = this.palette;
    const bars = order.slice(0, MAX_BARS).map((k) =>
      makeBar({
        name: this.domain.values[k],
        p: now[k],
        prior: before?.[k],
        hue: isColoured ? this.palette.ofValue(k) : "hue-0",
        mark: isColoured ? k : null,
      }),
    );
    const rest = order.slice(MAX_BARS);
    const sum = rest.reduce((total, k) => total + now[k], 0);
    if (rest.length > 0) bars.push(element("p", { class: "quiet" }, `and ${rest.length} others, together ${percent(sum)}`));
    if (before !== undefined) bars.push(element("p", { class: "quiet" }, "hollow: before the last answer"));
    return [element("div", { class: "attribute" }, ...bars), this.beliefs.length > 0 && this.domain.values.length <= 4 ? this.makeTable() : null];
  }

  /** Return the most probable value of a belief as elements: mark, name and probability. */
  describe(shared) {
    const k = shared.indexOf(Math.max(...shared));
    const mark = this.palette.isColoured ? makeKey(k) : null;
    return [mark, `${readable(this.domain.values[k])} ${percent(shared[k])}`].filter(Boolean);
  }
}
