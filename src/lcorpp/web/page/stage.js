// The stage: the hall in metres from above, the robot with its back to a wall, and the path of the person.

import { drawing, element, percent, readable } from "./dom.js";
import { indexOfLargest, makeKey, makeMark, mixColour } from "./marks.js";
import { HALL, START, TICK } from "./walks.js";

const SCALE = 40;
const MARGIN = { top: 8, bottom: 30 };
const WIDTH = (HALL.right - HALL.left) * SCALE;
export const STAGE_HEIGHT = (HALL.top - HALL.bottom) * SCALE + MARGIN.top + MARGIN.bottom;
const RINGS = [1, 2, 3, 4, 5, 6, 7, 8, 9];
const NEAR = 0.5;
const MARK_EVERY = 10;

export class Stage {
  /**
   * sense: of tracks. palette: of the domain. walker: the person's legs. onHover: takes the index of a position
   * under the pointer, or null.
   */
  constructor(sense, palette, walker, onHover) {
    this.walker = walker;
    this.onHover = onHover;
    this.classes = sense.classes;
    this.hues = sense.classes.map((name) => palette.indexOfClass(sense, name));
    this.trail = drawing("g", { class: "trail" });
    this.marks = drawing("g", {});
    this.aim = drawing("path", { class: "aim", d: "M-6,0 H6 M0,-6 V6", visibility: "hidden" });
    this.person = drawPerson();
    this.spot = drawing("circle", { class: "spot", r: 9, visibility: "hidden" });
    this.svg = drawing(
      "svg",
      {
        viewBox: `0 0 ${WIDTH} ${STAGE_HEIGHT}`,
        class: "stage",
        tabindex: 0,
        role: "application",
        "aria-roledescription": "hall seen from above",
        "aria-label": "You in front of the robot. Arrow keys walk, with Shift slowly, Space waits.",
        onpointerdown: (event) => this.press(event),
        onpointermove: (event) => this.movePointer(event),
        onpointerup: () => this.release(),
        onpointercancel: () => this.release(),
        onpointerleave: () => this.onHover(null),
      },
      ...drawHall(),
      this.trail,
      this.marks,
      this.spot,
      this.aim,
      this.person,
    );
    this.legend = element(
      "p",
      { class: "legend" },
      ...this.classes.map((name, k) => element("span", {}, makeKey(this.hues[k]), readable(name))),
    );
    this.reset();
  }

  reset() {
    this.path = [];
    this.coloured = 0;
    this.trail.replaceChildren();
    this.marks.replaceChildren();
    this.isHeld = false;
    this.place(START, 0, -1);
    this.highlight(null);
  }

  /** Show the positions so far; those without a prediction are dotted. */
  showPath(path) {
    for (let i = Math.max(1, this.trail.childElementCount + 1); i < path.length; i += 1) {
      const [[x1, y1], [x2, y2]] = [toPixels(path[i - 1]), toPixels(path[i])];
      this.trail.append(drawing("line", { x1, y1, x2, y2, class: "fresh" }));
    }
    this.path = path;
    const [x, y] = path.at(-1);
    const [px, py] = path.at(-Math.min(4, path.length));
    this.place([x, y], x - px, y - py);
    this.showAim();
  }

  /** Colour the path up to a prediction. */
  addPrediction({ index, probabilities }) {
    if (probabilities === null) return;
    const colour = mixColour(probabilities, this.hues);
    const k = indexOfLargest(probabilities);
    for (; this.coloured <= index; this.coloured += 1) {
      const line = this.trail.children[this.coloured - 1];
      if (line) {
        line.classList.remove("fresh");
        line.style.stroke = colour;
      }
      if (this.coloured % MARK_EVERY === 0) {
        const mark = makeMark(this.hues[k], ...toPixels(this.path[this.coloured]), 5);
        const seconds = (this.coloured * TICK).toFixed(0);
        mark.append(drawing("title", {}, `${seconds} s: ${readable(this.classes[k])} ${percent(probabilities[k])}`));
        this.marks.append(mark);
      }
    }
  }

  highlight(index) {
    const position = index === null ? undefined : this.path[index];
    this.spot.setAttribute("visibility", position ? "visible" : "hidden");
    if (position) move(this.spot, toPixels(position));
  }

  place(position, dx, dy) {
    move(this.person, toPixels(position));
    if (Math.hypot(dx, dy) > 0.02) this.angle = (Math.atan2(dx, dy) * 180) / Math.PI;
    this.person.firstElementChild.setAttribute("transform", `rotate(${this.angle})`);
  }

  showAim() {
    const target = this.walker.target;
    this.aim.setAttribute("visibility", target ? "visible" : "hidden");
    if (target) move(this.aim, toPixels(target));
  }

  press(event) {
    if (this.walker.isLocked || event.button !== 0) return;
    this.svg.setPointerCapture(event.pointerId);
    this.isHeld = true;
    this.walker.head(this.toMetres(event));
    event.preventDefault();
  }

  movePointer(event) {
    const place = this.toMetres(event);
    if (this.isHeld && !this.walker.isLocked) {
      this.walker.head(place);
      this.showAim();
    } else this.onHover(this.findNearest(place));
  }

  release() {
    this.isHeld = false;
    this.walker.halt();
    this.showAim();
  }

  findNearest([x, y]) {
    const distances = this.path.map(([px, py]) => Math.hypot(px - x, py - y));
    const nearest = Math.min(...distances);
    return nearest < NEAR ? distances.indexOf(nearest) : null;
  }

  toMetres(event) {
    const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(this.svg.getScreenCTM().inverse());
    return [point.x / SCALE + HALL.left, HALL.top - (point.y - MARGIN.top) / SCALE];
  }
}

/** Draw a path in the colours of a classifier's predictions, small: rows of {index, probabilities}. */
export function drawSmallPath(path, rows, hues) {
  const lines = [];
  for (let i = 1; i < path.length; i += 1) {
    const row = rows.findLast((own) => own.index <= i) ?? rows[0];
    const [[x1, y1], [x2, y2]] = [toPixels(path[i - 1]), toPixels(path[i])];
    const line = drawing("line", { x1, y1, x2, y2 });
    if (row) line.style.stroke = mixColour(row.probabilities, hues);
    lines.push(line);
  }
  const viewBox = `0 0 ${WIDTH} ${STAGE_HEIGHT}`;
  return drawing("svg", { viewBox, class: "stage small", "aria-hidden": "true" }, ...drawHall(), drawing("g", { class: "trail" }, ...lines));
}

function drawHall() {
  const [x, y] = toPixels([0, 0]);
  const wall = toPixels([0, HALL.bottom - 0.1])[1];
  const rings = RINGS.map((r) => drawing("circle", { class: "ring", cx: x, cy: y, r: r * SCALE }));
  const names = [1, 3, 5, 7].map((r) => {
    const [nx, ny] = toPixels([-r * Math.SQRT1_2, r * Math.SQRT1_2]);
    return drawing("text", { class: "ring-name", x: nx - 12, y: ny - 2 }, r === 1 ? "1 m" : String(r));
  });
  const bricks = Array.from({ length: 23 }, (_, i) => `M${i * 20 - 10},${wall + 22} l14,-22`).join(" ");
  const robot = drawing(
    "g",
    { class: "robot", transform: `translate(${x} ${y})` },
    drawing("path", { class: "sight", d: "M0,0 L-46,-74 A87,87 0 0 1 46,-74 Z" }),
    drawing("rect", { x: -15, y: -15, width: 30, height: 30, rx: 9 }),
    drawing("path", { class: "heading", d: "M-6,-4 L0,-12 L6,-4 Z" }),
    drawing("text", { x: 24, y: 6 }, "robot"),
  );
  return [
    drawing("rect", { class: "floor", width: WIDTH, height: wall }),
    ...rings,
    ...names,
    drawing("rect", { class: "wall", y: wall, width: WIDTH, height: STAGE_HEIGHT - wall }),
    drawing("path", { class: "bricks", d: bricks }),
    robot,
  ];
}

function drawPerson() {
  return drawing(
    "g",
    { class: "person" },
    drawing(
      "g",
      {},
      drawing("ellipse", { rx: 14, ry: 7 }),
      drawing("circle", { r: 7.5 }),
      drawing("path", { d: "M-3,-6 L0,-11 L3,-6 Z" }),
    ),
    drawing("text", { x: 20, y: 5 }, "you"),
  );
}

function move(shape, [x, y]) {
  shape.setAttribute("transform", `translate(${x} ${y})`);
}

function toPixels([x, y]) {
  return [(x - HALL.left) * SCALE, (HALL.top - y) * SCALE + MARGIN.top];
}
