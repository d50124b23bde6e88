// Elements of the page. All texts are set as text, never as markup.

const SVG = "http://www.w3.org/2000/svg";

/** Return an HTML element. attributes: name -> value; "on..." is a listener, false or null leaves a name out. */
export function element(name, attributes = {}, ...children) {
  return fill(document.createElement(name), attributes, children);
}

/** Return an SVG element, with arguments as of `element`. */
export function drawing(name, attributes = {}, ...children) {
  return fill(document.createElementNS(SVG, name), attributes, children);
}

/** Replace the children of an element of the page, and return it. */
export function show(id, ...children) {
  const parent = document.getElementById(id);
  parent.replaceChildren(...children.flat().filter(isContent));
  return parent;
}

/** Return a name of the domain, or the names of a tuple, as text. */
export function readable(name) {
  return [name].flat().map((part) => part.replaceAll("_", " ")).join(", ");
}

/** Return the domain's text for an action or observation; by default its name with spaces. */
export function phrase(domain, name) {
  return domain.phrases[name] ?? readable(name);
}

/** Return a probability as text with one decimal. */
export function percent(p) {
  return `${(100 * p).toFixed(1)} %`;
}

/** Return a value of an action as text with two decimals and a proper minus. */
export function decimal(value) {
  return value.toFixed(2).replace("-", "\u2212");
}

/** Return text that only screen readers show. */
export function spoken(text) {
  return element("span", { class: "hidden" }, text);
}

/** Return a table behind a picture, folded. rows: texts, the first one names the row. */
export function tableOf(summary, head, rows) {
  const body = rows.map(([first, ...rest]) =>
    element("tr", {}, element("th", { scope: "row" }, first), ...rest.map((cell) => element("td", {}, cell))),
  );
  return element(
    "details",
    { class: "table" },
    element("summary", {}, summary),
    element(
      "div",
      { class: "scroll", tabindex: 0, role: "group", "aria-label": summary },
      element(
        "table",
        {},
        element("thead", {}, element("tr", {}, ...head.map((text) => element("th", { scope: "col" }, text)))),
        element("tbody", {}, ...body),
      ),
    ),
  );
}

function isContent(child) {
  return child !== null && child !== undefined && child !== false;
}

function fill(made, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (value !== false && isContent(value)) made.setAttribute(name, value === true ? "" : value);
  }
  made.append(...children.flat().filter(isContent));
  return made;
}
