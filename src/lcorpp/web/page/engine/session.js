// The engine of the page in the page itself: lcorpp/web/session.py over the tables of a model.

import { PagePlanner } from "./planner.js";
import { Stream } from "./stream.js";
import { RequestError, checkRequest, isId } from "./requests.js";

const MAX_STEPS = 500;
const MAX_TRACK = 10000;

export class LocalSession {
  /** model: the JSON of lcorpp/web/model.py. */
  constructor(model) {
    this.model = model;
    this.domain = model.domain;
    this.planner = new PagePlanner(model);
    this.handlers = {
      hello: () => ({ type: "domain", ...this.domain }),
      start: () => this.start(),
      observe: (fields) => this.observe(fields),
      samples: (fields) => this.addSamples(fields),
      decide: () => this.decide(),
      answer: (fields) => this.answer(fields),
      judge: (fields) => this.judge(fields),
      record: () => this.record(),
    };
    this.start();
  }

  /** Return the reply to a request; a refused one changes nothing. */
  handle(request) {
    const id = isId(request?.id) ? request.id : null;
    const refuse = (error, place) => {
      if (!(error instanceof RequestError)) throw error;
      return { id, type: "error", code: error.code, message: `${place}${error.message}` };
    };
    let fields;
    try {
      fields = checkRequest(request);
    } catch (error) {
      return refuse(error, "");
    }
    try {
      return { id, ...this.handlers[request.type](fields) };
    } catch (error) {
      return refuse(error, `${request.type}: `);
    }
  }

  start() {
    this.facts = {};
    this.labels = {};
    this.streams = {};
    this.counts = {};
    for (const [name, classifier] of Object.entries(this.model.classifiers)) {
      this.streams[name] = new Stream(classifier);
      this.counts[name] = 0;
    }
    this.decision = null;
    this.belief = null;
    this.report = null;
    this.isDone = false;
    this.isJudged = false;
    this.steps = [];
    return { type: "started" };
  }

  observe({ facts, labels }) {
    require(this.decision === null, "the robot is already deciding; expected `start`");
    for (const [name, label] of Object.entries(labels)) {
      const sense = this.domain.senses.find((own) => own.name === name && own.kind === "choice");
      if (sense === undefined) throw invalid(`labels: '${name}' is not a sense whose label is chosen`);
      const known = sense.labels.map((own) => own.label);
      if (!known.includes(label)) throw invalid(`labels: ${name} '${label}'; ${oneOf(known)}`);
    }
    for (const [name, value] of Object.entries(facts)) {
      const fact = this.domain.facts.find((own) => own.name === name);
      if (fact === undefined) throw invalid(`'${name}' is not observed in ${this.domain.name}`);
      if (!fact.values.includes(value)) throw invalid(`${name} cannot be '${value}'; ${oneOf(fact.values)}`);
    }
    const { reply } = this.infer(facts, labels);
    this.facts = { ...facts };
    this.labels = { ...labels };
    return { type: "posterior", ...reply };
  }

  /** Return what follows from facts and labels, with those of the tracks so far: {reply, classes, prior}. */
  infer(facts, labels) {
    const evidence = { ...facts };
    const classes = {};
    for (const sense of this.domain.senses) {
      const label = sense.kind === "track" ? this.findLabel(sense) : labels[sense.name];
      if (label === null || label === undefined) continue;
      classes[sense.name] = sense.labels.find((own) => own.label === label).class;
      evidence[sense.attribute] = label;
    }
    const names = [...this.domain.facts.map((fact) => fact.name), ...this.domain.senses.map((s) => s.attribute)];
    const key = names.map((name) => evidence[name] ?? "").join("|");
    const known = find(this.model.posteriors, key);
    if (known === null) throw invalid("no possible world satisfies this evidence");
    const prior = this.planner.makePrior(known.shared);
    const byName = (values) => Object.fromEntries(this.domain.attributes.map((own, i) => [own.name, values[i]]));
    const world = Object.entries(byName(known.world)).filter(([, value]) => value !== null);
    const reply = {
      evidence,
      marginals: byName(known.marginals),
      shared: known.shared,
      fired: known.fired.map((rule) => this.model.rules[rule]),
      world: Object.fromEntries(world),
      world_probability: known.world_probability,
      belief: this.planner.listBelief(prior),
      fan: this.planner.drawFan(prior),
    };
    return { reply, classes, prior };
  }

  findLabel(sense) {
    const predicted = this.streams[sense.name].classify();
    return predicted === null ? null : sense.labels.find((own) => own.class === predicted).label;
  }

  addSamples({ sense, samples }) {
    require(this.decision === null, "the robot is already deciding; expected `start`");
    const stream = find(this.streams, sense);
    if (stream === null) throw invalid(`sense: '${sense}' is not a sense of tracks`);
    if (this.counts[sense] + samples.length > MAX_TRACK) {
      throw new RequestError("too_large", `expected at most ${MAX_TRACK} of them in a trial`);
    }
    for (const sample of samples) {
      if (sample.length !== 3) throw invalid(`samples: ${sample.length} numbers; expected time, x, y`);
    }
    stream.push(samples);
    this.counts[sense] += samples.length;
    const own = this.domain.senses.find((other) => other.name === sense);
    return {
      type: "prediction",
      sense,
      points: stream.points,
      track: stream.track,
      probabilities: stream.probabilities,
      label: this.findLabel(own),
    };
  }

  decide() {
    require(this.decision === null, "the robot is already deciding; expected `answer` or `start`");
    const { reply, classes, prior } = this.infer(this.facts, this.labels);
    this.decision = { ...reply, classes };
    return { type: "decision", ...reply, ...this.act(prior) };
  }

  act(belief) {
    this.belief = belief;
    const view = this.planner.view(belief);
    this.isDone = view.done;
    if (view.report !== null) {
      this.steps.push({ action: view.action, observation: null, belief: view.belief });
      this.report = view.report;
    }
    return view;
  }

  answer({ said, draw }) {
    require(this.belief !== null, "the robot has not asked; expected `decide` before");
    require(!this.isDone, "the decision has ended; expected `start`");
    if (this.steps.length >= MAX_STEPS) throw new RequestError("failed", `no report after ${MAX_STEPS} actions`);
    const action = this.planner.act(this.belief);
    const row = find(this.domain.noise[action], said);
    if (row === null) throw invalid(`said: '${said}'; ${oneOf(this.domain.observations)}`);
    const heard = this.domain.observations[drawIndex(row, draw)];
    const belief = this.planner.update(this.belief, action, heard);
    if (belief === null) throw invalid(`observation '${heard}' is impossible after action '${action}'`);
    this.steps.push({ action, observation: heard, belief: this.planner.listBelief(belief) });
    return { type: "step", said, heard, answered: action, ...this.act(belief) };
  }

  judge({ right, truth }) {
    require(this.report !== null, "the robot has not reported; expected `judge` after it");
    require(!this.isJudged, "this trial is already judged; expected `start`");
    if (right === (truth !== null)) {
      throw invalid("truth: expected the true value if the robot was wrong, else null");
    }
    if (truth !== null) {
      const text = truth.join(", ");
      const known = this.domain.values.map((value) => value.join(", "));
      if (!known.includes(text)) throw invalid(`truth: ${text}; ${oneOf(known)}`);
      if (text === this.report.join(", ")) {
        throw invalid(`truth: ${text} is what the robot reported; expected another value`);
      }
    }
    this.isJudged = true;
    return { type: "judged", learns: false, stored: 0, batch: 0 };
  }

  /** Return the trial as a line of the decision log. */
  record() {
    require(this.decision !== null, "there is no decision; expected `decide` before");
    const { facts, decision, domain, model } = this;
    const single = (value) => (value.length === 1 ? value[0] : value);
    const line = {
      ...model.log.head,
      facts,
      labels: decision.classes,
      evidence: decision.evidence,
      marginal: domain.values.map((value, v) => [single(value), decision.shared[v]]),
      prior: decision.belief,
      steps: this.steps,
      report: this.report === null ? null : single(this.report),
      seconds: {},
      parts: model.log.parts,
    };
    return { type: "recorded", line };
  }
}

function drawIndex(probabilities, draw) {
  let total = 0;
  for (let i = 0; i < probabilities.length; i += 1) {
    total += probabilities[i];
    if (draw < total) return i;
  }
  return probabilities.findLastIndex((p) => p > 0);
}

/** Return a property of an object itself; null for other names, such as "constructor". */
function find(object, name) {
  return Object.hasOwn(object, name) ? object[name] : null;
}

function require(condition, message) {
  if (!condition) throw new RequestError("out_of_order", message);
}

function invalid(message) {
  return new RequestError("invalid", message);
}

function oneOf(names) {
  return `expected one of ${names.join(", ")}`;
}
