// The strip chart beside the stage: class probabilities from left to right, time downwards as you walk.

import { drawing, element, percent, readable, tableOf } from "./dom.js";
import { indexOfLargest, makeMark, mixColour } from "./marks.js";
import { STAGE_HEIGHT } from "./stage.js";

const WIDTH = 150;
const [LEFT, RIGHT, TOP, BOTTOM] = [26, 138, 34, STAGE_HEIGHT - 10];
const MIN_SECONDS = 14;
const GRID_SECONDS = [2, 5, 10];

export class Strip {
  /** sense: of tracks. palette: of the domain. onHover: takes the index of a position, or null. */
  constructor(sense, palette, onHover) {
    this.classes = sense.classes;
    this.hues = sense.classes.map((name) => palette.indexOfClass(sense, name));
    this.onHover = onHover;
    this.svg = drawing("svg", {
      viewBox: `0 0 ${WIDTH} ${STAGE_HEIGHT}`,
      class: "strip",
      tabindex: 0,
      role: "slider",
      "aria-label": "Moment of your walk",
      "aria-orientation": "vertical",
      "aria-valuemin": 0,
      onpointermove: (event) => this.onHover(this.findMoment(event)),
      onpointerleave: () => this.onHover(null),
      onblur: () => this.onHover(null),
      onkeydown: (event) => this.press(event),
    });
    this.table = element("div", {});
    this.reset();
  }

  reset() {
    this.rows = [];
    this.marked = null;
    this.draw();
  }

  /** row: {index, time, points, probabilities}; one that adds no point to the classifier's track is left out. */
  add(row) {
    if (row.probabilities === null || row.points === this.rows.at(-1)?.points) return;
    this.rows.push(row);
    this.draw();
  }

  /** Mark the moment of a position of the path; null marks none. */
  highlight(index) {
    this.marked = index === null ? null : this.rows.findIndex((row) => row.index >= index);
    this.draw();
  }

  findMoment(event) {
    const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(this.svg.getScreenCTM().inverse());
    const time = ((point.y - TOP) / (BOTTOM - TOP)) * this.end;
    return this.rows.find((row) => row.time >= time)?.index ?? null;
  }

  press(event) {
    const step = { ArrowUp: -1, ArrowLeft: -1, ArrowDown: 1, ArrowRight: 1 }[event.key];
    if (step === undefined || this.rows.length === 0) return;
    event.preventDefault();
    event.stopPropagation();
    const from = this.marked ?? (step > 0 ? -1 : this.rows.length);
    const next = Math.min(this.rows.length - 1, Math.max(0, from + step));
    this.onHover(this.rows[next].index);
  }

  draw() {
    this.end = Math.max(MIN_SECONDS, this.rows.at(-1)?.time ?? 0);
    const chart = drawProbabilities(this.rows, this.hues, this.end);
    this.svg.replaceChildren(...chart, ...this.drawMoment());
    const row = this.rows[this.marked ?? this.rows.length - 1];
    this.svg.setAttribute("aria-valuemax", (this.rows.at(-1)?.time ?? 0).toFixed(1));
    this.svg.setAttribute("aria-valuenow", (row?.time ?? 0).toFixed(1));
    this.svg.setAttribute("aria-valuetext", row ? `${row.time.toFixed(1)} seconds: ${this.describe(row)}` : "no walk yet");
  }

  drawMoment() {
    const row = this.marked === null ? undefined : this.rows[this.marked];
    if (row === undefined) return [];
    const k = this.classes.length === 2 ? 0 : indexOfLargest(row.probabilities);
    const [x, y] = toPixels(row.time, row.probabilities[k], this.end);
    return [
      drawing("line", { class: "moment", x1: LEFT, x2: RIGHT, y1: y, y2: y }),
      drawing("circle", { class: "spot", cx: x, cy: y, r: 6 }),
    ];
  }

  describe(row) {
    return this.classes.map((name, k) => `${readable(name)} ${percent(row.probabilities[k])}`).join(", ");
  }

  /** Return the probabilities as a table, one row a second. */
  makeTable() {
    const rows = this.rows.filter((row, i) => i === this.rows.length - 1 || Math.floor(row.time) !== Math.floor(this.rows[i + 1].time));
    const cells = rows.map((row) => [row.time.toFixed(1), ...row.probabilities.map(percent)]);
    return tableOf("Walk as a table", ["seconds", ...this.classes.map(readable)], cells);
  }
}

/** Return the drawings of a strip chart. rows: {time, probabilities}; hues: of the classes; end: in seconds. */
export function drawProbabilities(rows, hues, end) {
  const every = GRID_SECONDS.find((own) => end / own <= 8) ?? 20;
  const ticks = Array.from({ length: Math.floor(end / every) + 1 }, (_, i) => i * every);
  const isPair = hues.length === 2;
  return [
    drawing("rect", { class: "floor", x: LEFT, y: TOP, width: RIGHT - LEFT, height: BOTTOM - TOP }),
    ...ticks.flatMap((time) => {
      const y = toPixels(time, 0, end)[1];
      return [
        drawing("line", { class: "grid", x1: LEFT, x2: RIGHT, y1: y, y2: y }),
        drawing("text", { class: "axis end", x: LEFT - 5, y: y + 5 }, time === 0 ? "0 s" : String(time)),
      ];
    }),
    drawing("line", { class: "grid middle", x1: (LEFT + RIGHT) / 2, x2: (LEFT + RIGHT) / 2, y1: TOP, y2: BOTTOM }),
    ...(isPair
      ? [makeMark(hues[1], LEFT + 6, 21, 5.5), makeMark(hues[0], RIGHT - 6, 21, 5.5)]
      : [
          drawing("text", { class: "axis", x: LEFT, y: 25 }, "0"),
          drawing("text", { class: "axis end", x: RIGHT, y: 25 }, "100 %"),
        ]),
    ...(isPair ? drawPair(rows, hues, end) : drawEach(rows, hues, end)),
  ];
}

/** One line, from the second class on the left to the first one on the right. */
function drawPair(rows, hues, end) {
  const lines = rows.slice(1).map((row, i) => {
    const [x1, y1] = toPixels(rows[i].time, rows[i].probabilities[0], end);
    const [x2, y2] = toPixels(row.time, row.probabilities[0], end);
    const line = drawing("line", { class: "curve", x1, y1, x2, y2 });
    line.style.stroke = mixColour(row.probabilities, hues);
    return line;
  });
  const last = rows.at(-1);
  if (!last) return lines;
  const k = indexOfLargest(last.probabilities);
  return [...lines, makeMark(hues[k], ...toPixels(last.time, last.probabilities[0], end), 6)];
}

function drawEach(rows, hues, end) {
  return hues.flatMap((hue, k) => {
    const points = rows.map((row) => toPixels(row.time, row.probabilities[k], end));
    const curve = drawing("polyline", { class: `curve hue-${hue}`, points: points.map((point) => point.join(",")).join(" ") });
    return points.length === 0 ? [] : [curve, makeMark(hue, ...points.at(-1), 6)];
  });
}

function toPixels(time, p, end) {
  return [LEFT + p * (RIGHT - LEFT), TOP + (time / end) * (BOTTOM - TOP)];
}
