// The engine of the page: Algorithm 2, one trial after another, over the model of a robot.
//
// A host gives what the page has not itself; its methods return promises:
//   start()                  begin a trial: the model (lcorpp/web/model.py), null if it is still the same
//   infer(facts, labels)     what follows from facts and classes: {evidence, marginals, shared, fired, world,
//                            world_probability}
//   classify(sense, samples) add samples to a track: {points, track, probabilities, class}; for senses whose
//                            classifier is not in the model
//   judge(facts, samples, value)  keep a trial with its true value: {stored, batch}
//   log(line)                keep a decision, a line of the decision log

import { LimitedPlan } from "./limits.js";
import { PagePlanner } from "./planner.js";
import { HostStream, Stream } from "./stream.js";

const MAX_STEPS = 500;
const MAX_TRACK = 10000;

/** What the engine does not do, with the reason for the person. */
export class Refusal extends Error {}

export class Session {
  /** domain: of the model, from the first `start` on. */
  constructor(host) {
    this.host = host;
    this.queue = Promise.resolve();
    this.model = null;
  }

  get domain() {
    return this.model.domain;
  }

  /** Do one thing after the other, in the order of the calls. */
  enqueue(work) {
    const done = this.queue.then(work);
    this.queue = done.catch(() => {});
    return done;
  }

  /** Begin a trial. */
  start() {
    return this.enqueue(async () => {
      const model = await this.host.start();
      if (model !== null && model !== this.model) {
        this.model = model;
        this.planner = new PagePlanner(model);
        this.plan = (model.limits ?? null) === null ? null : new LimitedPlan(model.limits, model.domain);
      }
      this.facts = {};
      this.labels = {};
      this.samples = {};
      this.streams = {};
      for (const { name } of this.domain.senses.filter((sense) => sense.kind === "track")) {
        const classifier = find(this.model.classifiers, name);
        this.samples[name] = [];
        this.streams[name] = classifier === null ? new HostStream(this.host, name) : new Stream(classifier);
      }
      this.decision = null;
      this.belief = null;
      this.report = null;
      this.node = null;
      this.isDone = false;
      this.isJudged = false;
      this.steps = [];
    });
  }

  /** Take what the robot observes, and the labels of senses without tracks; return what follows from them. */
  observe(facts, labels) {
    return this.enqueue(async () => {
      require(this.decision === null, "the robot is already deciding; expected a new trial");
      const names = Object.fromEntries(this.domain.facts.map((fact) => [fact.name, fact.values]));
      checkNames("fact", facts, names);
      const senses = this.domain.senses.filter((sense) => sense.kind === "choice");
      checkNames("label", labels, Object.fromEntries(senses.map((sense) => [sense.name, sense.labels.map((own) => own.label)])));
      const { reply } = await this.infer(facts, labels);
      this.facts = { ...facts };
      this.labels = { ...labels };
      return reply;
    });
  }

  /** Return what follows from facts and labels, with those of the tracks so far: {reply, classes, prior}. */
  async infer(facts, labels) {
    const classes = {};
    for (const sense of this.domain.senses) {
      const chosen = sense.labels.find((own) => own.label === labels[sense.name]);
      const name = sense.kind === "track" ? this.streams[sense.name].class : (chosen?.class ?? null);
      if (name !== null) classes[sense.name] = name;
    }
    const known = await this.host.infer(facts, classes);
    const prior = this.planner.makePrior(known.shared);
    const reply = { ...known, belief: this.planner.listBelief(prior), fan: this.planner.drawFan(prior) };
    return { reply, classes, prior };
  }

  /** Add samples [seconds, x, y] to the track of a sense; return its class probabilities. */
  addSamples(sense, samples) {
    return this.enqueue(async () => {
      require(this.decision === null, "the robot is already deciding; expected a new trial");
      const stream = this.streams[sense];
      const kept = this.samples[sense];
      require(kept.length + samples.length <= MAX_TRACK, `expected at most ${MAX_TRACK} samples in a trial`);
      await stream.push(samples);
      kept.push(...samples);
      const { points, track, probabilities, class: name } = stream;
      const { labels } = this.domain.senses.find((own) => own.name === sense);
      const label = name === null ? null : labels.find((own) => own.class === name).label;
      return { points, track, probabilities, label };
    });
  }

  /** Whether a decision begins with a draw. */
  get draws() {
    return this.plan !== null;
  }

  /** Let the robot decide: return what follows, and the view of its belief. draw: from 0 to below 1, see `draws`. */
  decide(draw = 0) {
    return this.enqueue(async () => {
      require(this.decision === null, "the robot is already deciding; expected an answer or a new trial");
      const { reply, classes, prior } = await this.infer(this.facts, this.labels);
      this.decision = { ...reply, classes };
      if (this.draws) this.node = reply.node ?? this.plan.drawNode(reply.evidence, prior, draw);
      return { ...reply, ...this.act(prior) };
    });
  }

  act(belief) {
    this.belief = belief;
    const view = this.draws
      ? this.planner.view(belief, this.plan.action(this.node), (heard) => this.plan.action(this.plan.follow(this.node, heard)))
      : this.planner.view(belief);
    this.isDone = view.done;
    if (view.report !== null) {
      this.steps.push({ action: view.action, observation: null, belief: view.belief });
      this.report = view.report;
    }
    return view;
  }

  /** Answer the robot's action. draw: from 0 to below 1, decides what it hears. */
  answer(said, draw) {
    return this.enqueue(async () => {
      require(this.belief !== null, "the robot has not asked; expected a decision before");
      require(!this.isDone, "the decision has ended; expected a new trial");
      require(this.steps.length < MAX_STEPS, `no report after ${MAX_STEPS} actions`);
      const action = this.draws ? this.plan.action(this.node) : this.planner.act(this.belief);
      const row = find(this.domain.noise[action], said);
      require(row !== null, `unknown answer '${said}'; ${oneOf(this.domain.observations)}`);
      const heard = this.domain.observations[drawIndex(row, draw)];
      const belief = this.planner.update(this.belief, action, heard);
      require(belief !== null, `observation '${heard}' is impossible after action '${action}'`);
      this.steps.push({ action, observation: heard, belief: this.planner.listBelief(belief) });
      if (this.draws) this.node = this.plan.follow(this.node, heard);
      return { said, heard, answered: action, ...this.act(belief) };
    });
  }

  /** Append the decision, which has ended, to the log. */
  log() {
    return this.enqueue(() => {
      require(this.isDone, "the decision has not ended; expected an answer before");
      return this.host.log(this.makeLine());
    });
  }

  /** Judge the report. truth: the true shared value if it was wrong, else null. */
  judge(truth) {
    return this.enqueue(async () => {
      require(this.report !== null, "the robot has not reported; expected a judgement after it");
      require(!this.isJudged, "this trial is already judged; expected a new trial");
      const names = this.domain.values.map(String);
      require(truth === null || names.includes(String(truth)), `unknown value '${truth}'; ${oneOf(names)}`);
      require(String(truth) !== String(this.report), `'${truth}' is what the robot reported; expected another value`);
      const kept = await this.host.judge(this.facts, this.samples, truth ?? this.report);
      this.isJudged = true;
      return kept;
    });
  }

  /** Return the trial as a line of the decision log. */
  record() {
    return this.enqueue(() => {
      require(this.decision !== null, "there is no decision; expected one before");
      return this.makeLine();
    });
  }

  makeLine() {
    const { facts, decision, domain, model } = this;
    const single = (value) => (value.length === 1 ? value[0] : value);
    return {
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

/** Refuse names or values that are not known. known: name -> its values. */
function checkNames(what, chosen, known) {
  for (const [name, value] of Object.entries(chosen)) {
    const values = find(known, name);
    require(values !== null, `unknown ${what} '${name}'; ${oneOf(Object.keys(known))}`);
    require(values.includes(value), `${name} cannot be '${value}'; ${oneOf(values)}`);
  }
}

/** Return a property of an object itself; null for other names, such as "constructor". */
function find(object, name) {
  return Object.hasOwn(object, name) ? object[name] : null;
}

function require(condition, message) {
  if (!condition) throw new Refusal(message);
}

function oneOf(names) {
  return names.length === 0 ? "expected none" : `expected one of ${names.join(", ")}`;
}
