// The fan of alpha vectors over two values: each is the value of a plan, a line over the belief; the highest counts.

import { decimal, drawing, phrase, readable } from "./dom.js";
import { makeMark } from "./marks.js";

const [WIDTH, HEIGHT] = [400, 300];
const [LEFT, RIGHT, TOP, BOTTOM] = [38, 388, 10, 214];
const [BAND, BAND_HEIGHT] = [222, 24];
const LINE = 266;
const MIN_LABEL = 52;
const LETTER = 7.4;

/** Return the picture. fan: [{action, values: [at value 0, at value 1]}]; beliefs: P(value 0), the last one is now. */
export function drawFan(fan, beliefs, domain, palette) {
  const pieces = findEnvelope(fan);
  const heights = pieces.flatMap((piece) => [piece.start, piece.end].map((p) => evaluateAt(piece.line, p)));
  const [low, high] = [Math.min(...heights), Math.max(...heights)];
  const margin = Math.max(1e-9, 0.12 * (high - low));
  const toX = (p) => LEFT + p * (RIGHT - LEFT);
  const toY = (value) => BOTTOM - ((value - low + margin) / (high - low + 2 * margin)) * (BOTTOM - TOP);
  const now = beliefs.at(-1);
  const piece = pieces.find((own) => now <= own.end + 1e-12) ?? pieces.at(-1);
  return drawing(
    "svg",
    {
      viewBox: `0 0 ${WIDTH} ${HEIGHT}`,
      class: "fan",
      role: "img",
      "aria-label": `${fan.length} plans over the belief; best now: ${phrase(domain, piece.line.action)}, worth ${decimal(evaluateAt(piece.line, now))}.`,
    },
    drawing("clipPath", { id: "fan-clip" }, drawing("rect", { x: LEFT, y: TOP, width: RIGHT - LEFT, height: BOTTOM - TOP })),
    ...mergeByAction(pieces).map(({ action, start, end }) =>
      drawing("rect", {
        class: `region ${palette.ofAction(action)}`,
        x: toX(start),
        y: TOP,
        width: toX(end) - toX(start),
        height: BOTTOM - TOP,
      }),
    ),
    drawing(
      "g",
      { "clip-path": "url(#fan-clip)" },
      ...fan.map((line) =>
        drawing("line", {
          class: `alpha ${palette.ofAction(line.action)}`,
          x1: toX(0),
          x2: toX(1),
          y1: toY(evaluateAt(line, 0)),
          y2: toY(evaluateAt(line, 1)),
        }),
      ),
    ),
    ...pieces.map(({ line, start, end }) =>
      drawing("line", {
        class: `envelope ${palette.ofAction(line.action)}`,
        x1: toX(start),
        x2: toX(end),
        y1: toY(evaluateAt(line, start)),
        y2: toY(evaluateAt(line, end)),
      }),
    ),
    drawing("text", { class: "axis", x: LEFT + 5, y: TOP + 15 }, "expected reward of each plan"),
    ...[low, high].map((value) => drawing("text", { class: "axis end", x: LEFT - 5, y: toY(value) + 5 }, roundOff(value))),
    ...drawBand(mergeByAction(pieces), toX, domain, palette),
    drawing("line", { class: "base", x1: LEFT, x2: RIGHT, y1: LINE, y2: LINE }),
    ...beliefs.slice(0, -1).map((p, i) => drawBead(toX(p), i)),
    drawing("line", { class: "drop", x1: toX(now), x2: toX(now), y1: toY(evaluateAt(piece.line, now)), y2: LINE }),
    drawing("circle", { class: "tip", cx: toX(now), cy: toY(evaluateAt(piece.line, now)), r: 4 }),
    drawing("circle", { class: "bead", cx: toX(now), cy: LINE, r: 10 }),
    ...drawEnds(domain),
  );
}

function drawBand(regions, toX, domain, palette) {
  return regions.flatMap(({ action, start, end }) => {
    const [x, width] = [toX(start), toX(end) - toX(start)];
    const rect = drawing("rect", { class: `band ${palette.ofAction(action)}`, x, y: BAND, width, height: BAND_HEIGHT });
    const name = phrase(domain, action);
    rect.append(drawing("title", {}, name));
    if (width < Math.max(MIN_LABEL, name.length * LETTER)) return [rect];
    return [rect, drawing("text", { class: "band-name", x: x + width / 2, y: BAND + 17 }, name)];
  });
}

function roundOff(value) {
  return value.toFixed(0).replace("-", "\u2212");
}

function drawBead(x, number) {
  const attributes = { class: "bead faint", transform: `translate(${x} ${LINE})` };
  return drawing("g", attributes, drawing("circle", { r: 8 }), drawing("text", { y: 4 }, String(number)));
}

function drawEnds(domain) {
  const y = HEIGHT - 6;
  return [
    makeMark(1, LEFT + 6, y - 5, 5.5),
    drawing("text", { class: "corner", x: LEFT + 17, y }, `surely ${readable(domain.values[1])}`),
    makeMark(0, RIGHT - 6, y - 5, 5.5),
    drawing("text", { class: "corner end", x: RIGHT - 17, y }, `surely ${readable(domain.values[0])}`),
  ];
}

/** Return the pieces [{line, start, end}] of the upper envelope, over the probability of the first value. */
function findEnvelope(fan) {
  const pieces = [];
  let start = 0;
  let line = fan.reduce((best, own) => (isHigher(own, best, 0) ? own : best));
  while (start < 1) {
    let [end, next] = [1, null];
    for (const own of fan) {
      const rise = slope(own) - slope(line);
      if (rise <= 1e-12) continue;
      const crossing = start + (evaluateAt(line, start) - evaluateAt(own, start)) / rise;
      if (crossing < end || (next !== null && crossing === end && slope(own) > slope(next))) [end, next] = [Math.max(start, crossing), own];
    }
    if (end > start) pieces.push({ line, start, end });
    if (next === null) break;
    [start, line] = [end, next];
  }
  return pieces;
}

function isHigher(one, other, p) {
  const difference = evaluateAt(one, p) - evaluateAt(other, p);
  return difference > 0 || (difference === 0 && slope(one) > slope(other));
}

/** Join neighbouring pieces whose plans begin with the same action. */
function mergeByAction(pieces) {
  const regions = [];
  for (const { line, start, end } of pieces) {
    const last = regions.at(-1);
    if (last?.action === line.action) last.end = end;
    else regions.push({ action: line.action, start, end });
  }
  return regions;
}

function slope(line) {
  return line.values[0] - line.values[1];
}

function evaluateAt(line, p) {
  return line.values[1] + p * slope(line);
}
