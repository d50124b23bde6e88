// It learns: was it right? After a batch, the confusion matrix and the last walk, before and after.

import { drawing, element, percent, readable, show, spoken } from "./dom.js";
import { showButtons } from "./dialogue.js";
import { makeKey } from "./marks.js";
import { drawProbabilities } from "./strip.js";
import { STAGE_HEIGHT, drawSmallPath } from "./stage.js";
import { TICK } from "./walks.js";

const MAX_BUTTONS = 4;
const NO_LEARNING =
  "This page does not learn: its classifier stays as it is. Under \u201clcorpp play\u201d the robot keeps your walk and trains again.";

export class Learning {
  /** domain: of the model. palette: of it. onJudge: takes the truth if it was wrong, else null. */
  constructor(domain, palette, onJudge) {
    this.domain = domain;
    this.palette = palette;
    this.onJudge = onJudge;
    this.status = element("p", { class: "quiet", id: "kept" });
    this.isTraining = false;
    this.path = [];
  }

  /** Ask whether a report was right. again: a button for the next trial. */
  ask(report, again) {
    if (!this.domain.learns) {
      showButtons("The trial is over", [again], element("p", { class: "quiet" }, NO_LEARNING));
      return;
    }
    const others = this.domain.values.filter((value) => String(value) !== String(report));
    const buttons = [{ text: "Yes", onpress: () => this.judge(null) }];
    const title = `${readable(report)}: was it right?`;
    if (others.length <= MAX_BUTTONS) {
      const wrong = others.map((value) => ({ text: `No: ${readable(value)}`, onpress: () => this.judge(value) }));
      showButtons(title, [...buttons, ...wrong]);
      return;
    }
    const choice = element("select", { "aria-label": "True value" }, ...others.map((value, i) => element("option", { value: i }, readable(value))));
    const wrong = { text: "No, it was:", onpress: () => this.judge(others[Number(choice.value)]) };
    showButtons(title, [...buttons, wrong], choice);
  }

  judge(truth) {
    this.judgement = truth === null ? "it was right" : `it was wrong, ${readable(truth)} is true`;
    this.onJudge(truth);
  }

  /** Show what was judged and kept. path: the walk that was judged. */
  thank({ stored, batch }, again, path) {
    this.path = path;
    const count = stored === 1 ? "1 walk is kept" : `${stored} walks are kept`;
    if (!this.isTraining) this.status.replaceChildren(`${count}; the classifier trains again after every ${batch}.`);
    showButtons(`You judged: ${this.judgement}`, [again], this.status);
  }

  /** Show a message that the server sent by itself, the comparison at once or behind a button. */
  push(message, sense, isAtOnce) {
    this.isTraining = message.type === "learning";
    if (this.isTraining) {
      this.status.replaceChildren("The classifier trains with your walks. ", element("progress", { "aria-label": "Training" }));
      return;
    }
    if (message.error !== undefined) {
      this.status.replaceChildren(`The classifier stays as it was: ${message.error}`);
      return;
    }
    this.status.replaceChildren("The classifier has learnt: see step 1.");
    this.makeComparison(message, sense);
    const open = () => document.getElementById("learning").classList.add("has-learnt");
    if (isAtOnce) open();
    else show("learnt-note", element("button", { type: "button", onclick: open }, "See what it learnt"));
  }

  makeComparison(message, sense) {
    const hues = message.classes.map((name) => this.palette.indexOfClass(sense, name));
    const columns = ["before", "after"].map((when, i) =>
      element(
        "section",
        {},
        element("h4", {}, `${when}: ${percent(message.accuracy[i])} right`),
        makeMatrix(message.classes, message[when], hues),
        ...this.makeWalk(message, when, hues),
      ),
    );
    const close = element("button", { type: "button", onclick: () => this.hide() }, "Back to the hall");
    show(
      "learnt",
      element("div", { class: "learnt-title" }, element("h3", {}, "It has learnt from your walks"), close),
      element("p", { class: "quiet" }, "Rows: what people wanted. Columns: what it read from walks it had not seen."),
      element("div", { class: "pair" }, ...columns),
    );
  }

  makeWalk({ track, classes }, when, hues) {
    if (track === null || track.times.length === 0) return [];
    const rows = track.times.map((time, i) => ({ index: Math.round(time / TICK), time, probabilities: track[when][i] }));
    const end = Math.max(6, track.times.at(-1));
    const chart = drawing("svg", { viewBox: `0 0 150 ${STAGE_HEIGHT}`, class: "strip", "aria-hidden": "true" }, ...drawProbabilities(rows, hues, end));
    const last = rows.at(-1).probabilities.map((p, k) => element("span", {}, makeName(classes[k], hues[k]), ` ${percent(p)}`));
    return [
      element("div", { class: "replay" }, drawSmallPath(this.isOwn(track) ? this.path : [], rows, hues), chart),
      element("p", { class: "legend" }, "last walk:", ...last),
    ];
  }

  /** Whether a track is the walk that was judged here, not one of another page. */
  isOwn(track) {
    return Math.abs((this.path.length - 1) * TICK - track.times.at(-1)) < 0.5;
  }

  hide() {
    document.getElementById("learning").classList.remove("has-learnt");
    show("learnt-note");
  }
}

/** Return a confusion matrix as a table, shaded by the share of its row. */
function makeMatrix(classes, counts, hues) {
  const rows = counts.map((row, i) => {
    const total = row.reduce((sum, count) => sum + count, 0) || 1;
    const cells = row.map((count, k) => {
      const cell = element("td", { class: k === i ? "right" : "" }, String(Math.round(count)));
      cell.style.setProperty("--share", `${Math.round((80 * count) / total)}%`);
      return cell;
    });
    return element("tr", {}, element("th", { scope: "row" }, makeKey(hues[i]), readable(classes[i])), ...cells);
  });
  const head = element("tr", {}, element("td", {}), ...classes.map((name, k) => element("th", { scope: "col" }, makeName(name, hues[k]))));
  return element("table", { class: "matrix" }, element("thead", {}, head), element("tbody", {}, ...rows));
}

/** Return the mark of a class; screen readers get its name. */
function makeName(name, hue) {
  return element("span", {}, makeKey(hue), spoken(readable(name)));
}
