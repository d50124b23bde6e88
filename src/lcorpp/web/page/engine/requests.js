// Checks of requests: those of lcorpp/web/requests.py, for requests that are already objects.

const MAX_SAMPLES = 64;
const MAX_NAME = 200;

export class RequestError extends Error {
  /** code: as docs/play.md lists them. */
  constructor(code, message) {
    super(message);
    this.code = code;
  }
}

export const FIELDS = {
  hello: {},
  start: {},
  observe: { facts: checkNames, labels: checkNames },
  samples: { sense: checkName, samples: checkSamples },
  decide: {},
  answer: { said: checkName, draw: checkDraw },
  judge: { right: checkBoolean, truth: checkTruth },
  record: {},
};

/** Return the fields of a request; throw a RequestError with the reason if it is refused. */
export function checkRequest(request) {
  if (!isObject(request)) refuse("malformed", "the request", request, "an object");
  if (!isId(request.id)) {
    throw new RequestError("malformed", `id: ${show(request.id)}; expected a whole number from 0 to 2^53`);
  }
  const { id: _, type, ...fields } = request;
  if (typeof type !== "string" || !Object.hasOwn(FIELDS, type)) {
    throw new RequestError("unknown_type", `type: ${show(type)}; expected one of ${Object.keys(FIELDS).join(", ")}`);
  }
  const names = Object.keys(FIELDS[type]);
  const given = Object.keys(fields);
  if (given.length !== names.length || !names.every((name) => given.includes(name))) {
    const listed = given.sort().map(show).join(", ") || "none";
    throw new RequestError("invalid", `${type}: the fields ${listed}; expected ${names.join(", ") || "none"}`);
  }
  for (const name of names) {
    try {
      FIELDS[type][name](name, fields[name]);
    } catch (error) {
      throw new RequestError(error.code, `${type}: ${error.message}`);
    }
  }
  return fields;
}

export function isId(value) {
  return Number.isSafeInteger(value) && value >= 0;
}

function checkName(field, value) {
  if (typeof value !== "string" || value.length < 1 || value.length > MAX_NAME) {
    refuse("invalid", field, value, "a name");
  }
}

function checkNames(field, value) {
  if (!isObject(value)) refuse("invalid", field, value, "an object of names");
  for (const [name, own] of Object.entries(value)) {
    checkName(field, name);
    checkName(field, own);
  }
}

function checkSamples(field, value) {
  if (!Array.isArray(value) || value.length < 1 || value.length > MAX_SAMPLES) {
    refuse("invalid", field, value, `1 to ${MAX_SAMPLES} samples [time, value, ...]`);
  }
  for (const sample of value) {
    if (!Array.isArray(sample) || sample.length < 2 || sample.length > 9 || !sample.every(Number.isFinite)) {
      refuse("invalid", field, sample, "a sample [time, value, ...] of finite numbers");
    }
  }
}

function checkDraw(field, value) {
  if (!Number.isFinite(value) || value < 0 || value >= 1) {
    refuse("invalid", field, value, "a number from 0 to below 1");
  }
}

function checkBoolean(field, value) {
  if (typeof value !== "boolean") refuse("invalid", field, value, "true or false");
}

function checkTruth(field, value) {
  if (value === null) return;
  if (!Array.isArray(value) || value.length < 1 || value.length > MAX_SAMPLES) {
    refuse("invalid", field, value, "null, or a value of each shared variable");
  }
  for (const name of value) checkName(field, name);
}

function isObject(value) {
  return typeof value === "object" && value !== null && !Array.isArray(value);
}

function refuse(code, field, value, expected) {
  throw new RequestError(code, `${field}: ${show(value)}; expected ${expected}`);
}

/** Return the beginning of a value as JSON. */
function show(value) {
  const text = JSON.stringify(value === undefined ? null : value);
  return text.length <= 60 ? text : `${text.slice(0, 57)}...`;
}
