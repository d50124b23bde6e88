// One trial after another: what you do goes to the engine, in its order, and what it returns to the views.

import { makeGenerator } from "./address.js";
import { TICK } from "./walks.js";

const BATCH = 4;

export class Trial {
  /**
   * session: the engine. sense: the sense of tracks, or null. views: functions {refused(message), started(),
   * predicted(prediction), inferred(posterior), acted(view, step), judged(reply)}.
   */
  constructor(session, sense, views) {
    this.session = session;
    this.sense = sense;
    this.views = views;
    this.queue = Promise.resolve();
    this.number = 0;
  }

  /** Begin a trial with facts and labels. */
  begin(seed, facts, labels) {
    this.number += 1;
    this.clearTrack();
    this.phase = "before";
    return this.enqueue(async () => {
      Object.assign(this, { seed, facts: {}, labels: {}, answers: null, view: null, posterior: null });
      this.draw = makeGenerator(seed);
      await this.start();
      try {
        await this.observe(facts, labels);
      } catch (error) {
        await this.observe({}, {});
        throw error;
      }
    });
  }

  /** Forget the walk, and keep facts and labels. */
  beginTrack() {
    this.number += 1;
    this.clearTrack();
    return this.enqueue(async () => {
      await this.start();
      await this.observe(this.facts, this.labels);
    });
  }

  async start() {
    await this.session.start();
    this.views.started();
  }

  /** Change a fact, or the label of a sense; null for unknown. */
  choose(kind, name, value) {
    return this.enqueue(async () => {
      const changed = { facts: { ...this.facts }, labels: { ...this.labels } };
      if (value === null) delete changed[kind][name];
      else changed[kind][name] = value;
      await this.observe(changed.facts, changed.labels);
    });
  }

  async observe(facts, labels) {
    const reply = await this.session.observe(facts, labels);
    Object.assign(this, { facts, labels, posterior: reply });
    this.views.inferred(reply);
  }

  clearTrack() {
    this.path = [];
    this.sent = 0;
    this.predictions = [];
    this.label = null;
    this.pumping = null;
  }

  /** Take the positions so far; those that are new become samples. */
  walk(path) {
    this.path = path;
    this.pumping = this.pumping ?? this.pump(this.number);
  }

  /** Send samples, a few at a time, until there are no more: a slow engine gets more of them at a time. */
  async pump(number) {
    try {
      while (number === this.number && this.sent < this.path.length) {
        const end = Math.min(this.path.length, this.sent + BATCH);
        const samples = this.path.slice(this.sent, end).map(([x, y], i) => [seconds(this.sent + i), x, y]);
        this.sent = end;
        const reply = await this.session.addSamples(this.sense.name, samples);
        if (number !== this.number) return;
        const { probabilities, label, points } = reply;
        const prediction = { index: end - 1, time: seconds(end - 1), points, probabilities, label };
        this.predictions.push(prediction);
        this.views.predicted(prediction);
        if (label !== this.label) {
          this.label = label;
          await this.observe(this.facts, this.labels);
        }
      }
    } catch (error) {
      this.views.refused(error.message);
    } finally {
      if (number === this.number) this.pumping = null;
    }
  }

  /** Let the robot decide. */
  decide() {
    return this.enqueue(async () => {
      if (this.phase !== "before") return;
      await this.pumping;
      const reply = await (this.session.draws ? this.session.decide(this.draw()) : this.session.decide());
      this.posterior = reply;
      this.answers = [];
      this.views.inferred(reply);
      await this.act(reply, null);
    });
  }

  /** Answer the robot's action with an observation. */
  answer(said) {
    return this.enqueue(async () => {
      if (this.phase !== "asking") return;
      const reply = await this.session.answer(said, this.draw());
      this.answers.push(said);
      await this.act(reply, reply);
    });
  }

  async act(view, step) {
    this.view = view;
    this.phase = view.done ? "done" : "asking";
    this.views.acted(view, step);
    if (view.done) await this.session.log();
  }

  /** Judge the report. truth: the true shared value if it was wrong, else null. */
  judge(truth) {
    return this.enqueue(async () => {
      if (this.phase !== "done") return;
      const reply = await this.session.judge(truth);
      this.phase = "judged";
      this.views.judged(reply);
    });
  }

  /** Return the trial as a line of the decision log. */
  record() {
    return this.session.record();
  }

  enqueue(work) {
    this.queue = this.queue.then(work).catch((error) => this.views.refused(error.message));
    return this.queue;
  }
}

function seconds(index) {
  return Math.round(index * TICK * 1000) / 1000;
}
