// A bar of a probability with its name, the prior hollow behind it; as a button where it can be chosen.

import { drawing, element, percent, readable, spoken } from "./dom.js";
import { makeKey } from "./marks.js";

/**
 * Return a row: name, bar and number. p: probability; prior: as p, or undefined or null for none behind it.
 * hue: style class. mark: index of the shape of a value, or null. onpress and isPressed: for a button.
 */
export function makeBar({ name, p, prior, hue, mark = null, onpress = null, isPressed = false, isDisabled = false }) {
  const content = [
    element("span", { class: "bar-name" }, mark === null ? null : makeKey(mark), readable(name)),
    element("span", { class: "bar-number" }, percent(p)),
    drawBar(p, prior, hue),
    prior === undefined || prior === null ? null : spoken(` prior ${percent(prior)}`),
  ];
  if (onpress === null) return element("div", { class: "bar" }, ...content);
  return element(
    "button",
    { type: "button", class: "bar", "aria-pressed": String(isPressed), disabled: isDisabled, onclick: onpress },
    ...content,
  );
}

function drawBar(p, prior, hue) {
  const box = { viewBox: "0 0 100 8", preserveAspectRatio: "none", class: `bar-picture ${hue}`, "aria-hidden": "true" };
  const own = drawing("rect", { class: "own", y: 2, width: 100 * p, height: 4 });
  if (prior === undefined || prior === null) return drawing("svg", box, own);
  const width = Math.max(0.5, 100 * prior);
  return drawing("svg", box, own, drawing("rect", { class: "prior", x: 0, y: 0.5, width, height: 7 }));
}
