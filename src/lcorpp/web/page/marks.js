// Colours and shapes: each value has a colour and a shape of its own, each action the colour of what it does.

import { drawing } from "./dom.js";

const SHAPES = {
  circle: null,
  triangle: [[0, -1.15], [1.1, 0.85], [-1.1, 0.85]],
  square: [[-0.9, -0.9], [0.9, -0.9], [0.9, 0.9], [-0.9, 0.9]],
  diamond: [[0, -1.25], [1.25, 0], [0, 1.25], [-1.25, 0]],
};
const HUES = 4;
const QUESTION_HUES = 4;

export class Palette {
  /** domain: of the model. */
  constructor(domain) {
    this.domain = domain;
    this.isColoured = domain.values.length <= HUES;
    this.questions = domain.actions.filter((action) => action.report === null).map((action) => action.name);
    this.reports = new Map(
      domain.actions.filter((action) => action.report !== null).map((action) => [action.name, String(action.report)]),
    );
  }

  /** Return the hue, a style class, of a shared value by its index. */
  ofValue(index) {
    return this.isColoured ? `hue-${index}` : "hue-plain";
  }

  /** Return the index of the shared value that a class of a sense stands for, else the index of the class. */
  indexOfClass(sense, name) {
    const value = this.domain.values.findIndex((own) => own.length === 1 && own[0] === name);
    return (value >= 0 ? value : sense.classes.indexOf(name)) % HUES;
  }

  /** Return the hue of an action: that of the value that it reports, or one of the questions' own. */
  ofAction(name) {
    const question = this.questions.indexOf(name);
    if (question >= 0) return `ask-${question % QUESTION_HUES}`;
    return this.ofValue(this.domain.values.findIndex((value) => String(value) === this.reports.get(name)));
  }
}

/** Return the mark of a value at (x, y): its shape, in its hue. */
export function makeMark(index, x, y, radius, attributes = {}) {
  const corners = Object.values(SHAPES)[index % HUES];
  const own = { ...attributes, class: `mark hue-${index % HUES} ${attributes.class ?? ""}` };
  if (corners === null) return drawing("circle", { cx: x, cy: y, r: radius, ...own });
  const points = corners.map(([dx, dy]) => `${x + dx * radius},${y + dy * radius}`).join(" ");
  return drawing("polygon", { points, ...own });
}

/** Return a mark as a small picture within a line of text. */
export function makeKey(index) {
  return drawing("svg", { viewBox: "0 0 14 14", class: "key", "aria-hidden": "true" }, makeMark(index, 7, 7, 5));
}

/** Return the colour of class probabilities: grey if all are equal, else towards the hue of the largest. */
export function mixColour(probabilities, hues) {
  const k = indexOfLargest(probabilities);
  const even = 1 / probabilities.length;
  const share = Math.min(1, 1.25 * Math.max(0, (probabilities[k] - even) / (1 - even)));
  return `color-mix(in oklab, var(--value-${hues[k]}) ${(100 * share).toFixed(0)}%, var(--unsure))`;
}

/** Return the index of the largest number, the first of equals. */
export function indexOfLargest(values) {
  return values.indexOf(Math.max(...values));
}
