// What the robot does: its actions as a strip of panels, and the answers as large buttons.

import { drawing, element, phrase, readable, show } from "./dom.js";

const MAX_KEYS = 9;

export class Dialogue {
  /**
   * domain: of the model. describe: returns a belief's most probable value as elements.
   * onDecide: called when the robot shall decide. onAnswer: takes an observation.
   */
  constructor(domain, describe, onDecide, onAnswer) {
    this.domain = domain;
    this.describe = describe;
    this.onDecide = onDecide;
    this.onAnswer = onAnswer;
  }

  /** Show that the robot still watches. */
  reset() {
    this.panels = [];
    show("panels", element("li", { class: "panel-empty" }, "The robot watches. Nothing has been said yet."));
    show(
      "replies",
      element("h3", {}, "When you are ready"),
      element("button", { type: "button", class: "primary", id: "decide", onclick: this.onDecide }, "Let the robot decide"),
    );
  }

  /** Show a view of the robot, after a step or after the decision to act (step null). */
  add(view, step) {
    if (step !== null) this.panels.at(-1).step = step;
    if (view.action !== null) this.panels.push({ action: view.action, report: view.report, step: null });
    const panels = show("panels", ...this.panels.map((panel, i) => this.makePanel(panel, i)));
    panels.lastElementChild?.scrollIntoView({ block: "nearest", inline: "end" });
    if (!view.done) this.showAnswers(view.action);
    else if (view.action === null) showButtons("The trial is over", []);
  }

  showAnswers(action) {
    const buttons = this.domain.answers[action].map((said) => ({
      text: phrase(this.domain, said),
      onpress: () => this.onAnswer(said),
    }));
    showButtons(`${capitalize(phrase(this.domain, action))}: your answer?`, buttons);
  }

  makePanel({ action, report, step }, i) {
    const isNow = i === this.panels.length - 1;
    const name = report === null ? phrase(this.domain, action) : readable(report);
    const act = element(
      "p",
      { class: "act" },
      drawFace(report !== null),
      element("span", {}, report === null ? null : element("small", {}, "reports "), element("strong", {}, name)),
    );
    const kind = report === null ? (isNow ? "now" : "past") : "report";
    return element("li", { class: `panel ${kind}` }, act, ...(step === null ? [this.makeWaiting(report)] : this.makeHeard(step)));
  }

  makeWaiting(report) {
    return element("p", { class: "quiet" }, report === null ? "waits for you" : "and the trial ends");
  }

  makeHeard({ said, heard, shared }) {
    const isMisheard = said !== heard;
    return [
      element(
        "dl",
        { class: isMisheard ? "heard misheard" : "heard" },
        element("dt", {}, "you said"),
        element("dd", {}, phrase(this.domain, said)),
        element("dt", {}, "it heard"),
        element("dd", {}, `${phrase(this.domain, heard)}${isMisheard ? ", wrongly" : ""}`),
      ),
      element("p", { class: "then" }, "\u2192 ", ...this.describe(shared)),
    ];
  }
}

/** Show a title and large buttons [{text, onpress, hasKey}], with the keys 1 to 9 unless hasKey is false. */
export function showButtons(title, buttons, ...more) {
  const made = buttons.map(({ text, onpress, hasKey = true }, i) => {
    const key = hasKey && i < MAX_KEYS ? String(i + 1) : null;
    const sign = key === null ? null : element("kbd", { "aria-hidden": "true" }, key);
    return element("button", { type: "button", class: "answer", "data-key": key, onclick: onpress }, sign, text);
  });
  const hasFocus = document.activeElement === document.body || document.activeElement?.closest("#replies");
  show("replies", element("h3", {}, title), element("div", { class: "answers" }, ...made), ...more);
  if (hasFocus) made[0]?.focus({ preventScroll: true });
  if (made.length > 0) document.getElementById("replies").scrollIntoView({ block: "nearest" });
}

/** Press the button with a key; return whether there is one. */
export function pressKey(key) {
  const button = document.querySelector(`#replies [data-key="${key}"]`);
  button?.click();
  return button !== null;
}

function drawFace(isReport) {
  const bubble = isReport ? "M31,3 h18 v13 h-12 l-5,5 z" : "M31,3 h18 v13 h-12 l-5,5 z M36,8 h8 M36,11.500 h6";
  return drawing(
    "svg",
    { viewBox: "0 0 52 34", class: "face", "aria-hidden": "true" },
    drawing("rect", { x: 3, y: 10, width: 22, height: 18, rx: 6 }),
    drawing("circle", { cx: 10, cy: 18, r: 2.4 }),
    drawing("circle", { cx: 18, cy: 18, r: 2.4 }),
    drawing("path", { d: "M14,10 V4 M7,31 h14" }),
    drawing("path", { class: isReport ? "bubble full" : "bubble", d: bubble }),
  );
}

function capitalize(text) {
  return text.charAt(0).toUpperCase() + text.slice(1);
}
