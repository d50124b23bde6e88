// The state of a trial in the fragment of the address: facts, labels, walk, seed and answers.

const ALPHABET = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";
const ZERO = 32;
const MAX_POINTS = 600;

/** Return {seed, facts, labels, walk, path, answers} of a fragment; null stands for what it does not name. */
export function readAddress(fragment) {
  const given = new URLSearchParams(fragment.replace(/^#/, ""));
  const collect = (prefix) =>
    Object.fromEntries([...given].filter(([name]) => name.startsWith(prefix)).map(([name, v]) => [name.slice(prefix.length), v]));
  const seed = Number.parseInt(given.get("seed") ?? "", 10);
  return {
    seed: Number.isInteger(seed) ? seed >>> 0 : null,
    facts: collect("fact."),
    labels: collect("label."),
    walk: given.get("walk"),
    path: decodePath(given.get("path") ?? ""),
    answers: given.has("answers") ? given.get("answers").split(",").filter((said) => said !== "") : null,
  };
}

/** Return the fragment of a state. path: positions in metres, to the centimetre; null without. */
export function writeAddress({ seed, facts, labels, walk, path, answers }) {
  const given = new URLSearchParams({ seed: String(seed) });
  for (const [name, value] of Object.entries(facts)) given.set(`fact.${name}`, value);
  for (const [name, value] of Object.entries(labels)) given.set(`label.${name}`, value);
  if (walk) given.set("walk", walk);
  else if (path) given.set("path", encodePath(path));
  if (answers) given.set("answers", answers.join(","));
  return `#${given.toString().replaceAll("%2C", ",")}`;
}

/** Return a generator of numbers from 0 to below 1 (mulberry32), so that a trial can be repeated. */
export function makeGenerator(seed) {
  let state = seed >>> 0;
  return () => {
    state = (state + 0x6d2b79f5) >>> 0;
    let mixed = Math.imul(state ^ (state >>> 15), 1 | state);
    mixed = (mixed + Math.imul(mixed ^ (mixed >>> 7), 61 | mixed)) ^ mixed;
    return ((mixed ^ (mixed >>> 14)) >>> 0) / 4294967296;
  };
}

/** Return positions as text: the first one in centimetres, then two letters for each step of at most 31 cm. */
function encodePath(path) {
  const places = path.map((position) => position.map((metres) => Math.round(100 * metres)));
  const steps = places.slice(1).map(([x, y], i) => ALPHABET[x - places[i][0] + ZERO] + ALPHABET[y - places[i][1] + ZERO]);
  return `${places[0].join(",")},${steps.join("")}`;
}

function decodePath(text) {
  const found = /^(-?\d{1,4}),(-?\d{1,4}),((?:[\w-]{2})*)$/.exec(text);
  if (found === null || found[3].length > 2 * MAX_POINTS) return null;
  let [x, y] = [Number(found[1]), Number(found[2])];
  const path = [[x / 100, y / 100]];
  for (let i = 0; i < found[3].length; i += 2) {
    x += ALPHABET.indexOf(found[3][i]) - ZERO;
    y += ALPHABET.indexOf(found[3][i + 1]) - ZERO;
    path.push([x / 100, y / 100]);
  }
  return path;
}
