// The triangle of beliefs over three values: a corner is certainty, a region the beliefs with the same best action.

import { drawing, percent, phrase, readable } from "./dom.js";
import { makeMark } from "./marks.js";

const [WIDTH, HEIGHT] = [400, 300];
const CORNERS = [[200, 34], [52, 266], [348, 266]];
const LETTER = 7.2;

/** Return the picture. fan: [{action, values: [at each corner]}]; beliefs: distributions, the last one is now. */
export function drawTriangle(fan, beliefs, domain, palette) {
  const regions = fan.map((own, i) => ({ action: own.action, corners: clipRegion(own, fan.slice(0, i), fan.slice(i + 1)) }));
  const shown = regions.filter(({ corners }) => corners.length >= 3);
  const places = beliefs.map(toPixels);
  const now = beliefs.at(-1);
  return drawing(
    "svg",
    {
      viewBox: `0 0 ${WIDTH} ${HEIGHT}`,
      class: "triangle",
      role: "img",
      "aria-label": `Belief: ${domain.values.map((value, k) => `${readable(value)} ${percent(now[k])}`).join(", ")}.`,
    },
    ...shown.map(({ action, corners }) => {
      const region = drawing("polygon", { class: `band ${palette.ofAction(action)}`, points: toPoints(corners) });
      region.append(drawing("title", {}, phrase(domain, action)));
      return region;
    }),
    drawing("polygon", { class: "outline", points: CORNERS.map((corner) => corner.join(",")).join(" ") }),
    ...nameRegions(shown, domain),
    drawing("polyline", { class: "drop", points: places.map((place) => place.join(",")).join(" ") }),
    ...places.slice(0, -1).map(([x, y], i) =>
      drawing(
        "g",
        { class: "bead faint", transform: `translate(${x} ${y})` },
        drawing("circle", { r: 8 }),
        drawing("text", { y: 4 }, String(i)),
      ),
    ),
    drawing("circle", { class: "bead", cx: places.at(-1)[0], cy: places.at(-1)[1], r: 10 }),
    ...nameCorners(domain),
  );
}

function nameCorners(domain) {
  const [top, left, right] = domain.values.map(readable);
  return [
    makeMark(0, 200, 8, 5.5),
    drawing("text", { class: "corner middle", x: 200, y: 27 }, top),
    makeMark(1, 20, 281, 5.5),
    drawing("text", { class: "corner", x: 31, y: 286 }, left),
    makeMark(2, 380, 281, 5.5),
    drawing("text", { class: "corner end", x: 369, y: 286 }, right),
  ];
}

/** Name an action once, in its largest region, if there is room. */
function nameRegions(regions, domain) {
  const largest = new Map();
  for (const { action, corners } of regions) {
    const places = corners.map(toPixels);
    const area = computeArea(places);
    const width = Math.max(...places.map(([x]) => x)) - Math.min(...places.map(([x]) => x));
    const hasRoom = width > LETTER * phrase(domain, action).length && area > 14 * width;
    if (hasRoom && area > (largest.get(action)?.area ?? 0)) largest.set(action, { area, corners });
  }
  return [...largest].map(([action, { corners }]) => {
    const places = corners.map(toPixels);
    const [x, y] = [0, 1].map((i) => places.reduce((sum, place) => sum + place[i], 0) / places.length);
    return drawing("text", { class: "band-name", x, y: y + 4 }, phrase(domain, action));
  });
}

/** Return the corners of the beliefs where a plan is at least as good as all others; the first of equals has them. */
function clipRegion(plan, before, after) {
  let corners = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  for (const [others, isEarlier] of [[before, true], [after, false]]) {
    for (const other of others) {
      const gain = plan.values.map((value, k) => value - other.values[k]);
      const isEqual = gain.every((own) => own === 0);
      if (isEqual && isEarlier) return [];
      if (!isEqual) corners = clip(corners, gain);
    }
  }
  return corners;
}

/** Keep the part of a convex polygon of beliefs where gain . belief >= 0 (Sutherland and Hodgman). */
function clip(corners, gain) {
  const heights = corners.map((corner) => corner.reduce((sum, p, k) => sum + p * gain[k], 0));
  return corners.flatMap((corner, i) => {
    const next = (i + 1) % corners.length;
    const kept = heights[i] >= 0 ? [corner] : [];
    if (heights[i] >= 0 === heights[next] >= 0) return kept;
    const share = heights[i] / (heights[i] - heights[next]);
    return [...kept, corner.map((p, k) => p + share * (corners[next][k] - p))];
  });
}

function computeArea(places) {
  const twice = places.reduce((sum, [x, y], i) => {
    const [nx, ny] = places[(i + 1) % places.length];
    return sum + x * ny - nx * y;
  }, 0);
  return Math.abs(twice) / 2;
}

function toPixels(belief) {
  return [0, 1].map((i) => belief.reduce((sum, p, k) => sum + p * CORNERS[k][i], 0));
}

function toPoints(corners) {
  return corners.map((corner) => toPixels(corner).join(",")).join(" ");
}
