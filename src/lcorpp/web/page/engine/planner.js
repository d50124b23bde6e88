// Beliefs and the policy, as lcorpp/planning/belief.py and policy.py, and what the page shows of a belief.

import { decodeNumbers } from "./lstm.js";
import { indexOfMaximum } from "./stream.js";

const MIN_PROBABILITY = 2.2250738585072014e-308;
const MIN_OUTCOME = 1e-12;
const TERMINAL_TOLERANCE = 1e-9;
const TRIANGLE_STEPS = 40;
const LINE_STEPS = 4000;

export class PagePlanner {
  /** model: of the page. */
  constructor(model) {
    const { planner, domain } = model;
    this.planner = planner;
    this.domain = domain;
    this.actions = domain.actions.map((action) => action.name);
    this.sets = planner.sets.map((part) => ({
      states: part.states,
      actions: part.actions,
      vectors: Float64Array.from(decodeNumbers(part.vectors, Int32Array), (count) => count * part.quantum),
    }));
    this.reports = Object.fromEntries(domain.actions.map((action) => [action.name, action.report]));
  }

  /** Return the belief of a distribution over the shared values. */
  makePrior(shared) {
    return this.planner.states.map((_, s) =>
      shared.reduce((sum, p, v) => sum + p * this.planner.initial_states[v][s], 0),
    );
  }

  predict(belief, action) {
    const predicted = new Array(belief.length).fill(0);
    for (const [from, to, p] of this.planner.T[action]) predicted[to] += belief[from] * p;
    return predicted;
  }

  /** Return the belief after an action and an observation; null if the observation is impossible. */
  update(belief, action, observation) {
    const o = this.domain.observations.indexOf(observation);
    const [after] = this.split(belief, action).filter((outcome) => outcome.o === o);
    return after === undefined ? null : after.belief;
  }

  /** Return [{o, probability, belief}] for each possible observation. */
  split(belief, action) {
    const predicted = this.predict(belief, action);
    const weights = new Map();
    for (const [state, o, p] of this.planner.O[action]) {
      if (!weights.has(o)) weights.set(o, new Array(belief.length).fill(0));
      weights.get(o)[state] = predicted[state] * p;
    }
    return [...weights.entries()]
      .map(([o, own]) => ({ o, own, probability: own.reduce((sum, w) => sum + w, 0) }))
      .filter(({ probability }) => probability >= MIN_PROBABILITY)
      .map(({ o, own, probability }) => ({ o, probability, belief: own.map((w) => w / probability) }))
      .sort((a, b) => a.o - b.o);
  }

  isTerminal(belief) {
    return this.planner.terminal.reduce((sum, s) => sum + belief[s], 0) > 1 - TERMINAL_TOLERANCE;
  }

  /** Return [value, index of the action] of the policy. */
  evaluate(belief) {
    let best = [-Infinity, -1];
    for (const part of this.findSets(belief)) {
      const n = part.states.length;
      const inside = part.states.map((s) => belief[s]);
      const values = part.actions.map((_, k) => {
        let sum = 0;
        for (let i = 0; i < n; i += 1) sum += part.vectors[k * n + i] * inside[i];
        return sum;
      });
      const k = indexOfMaximum(values);
      let value = values[k];
      if (n !== belief.length) value += this.planner.floor * Math.max(0, add(belief) - add(inside));
      if (value > best[0]) best = [value, part.actions[k]];
    }
    return best;
  }

  findSets(belief) {
    if (this.sets.length === 1) return this.sets;
    const support = belief.flatMap((p, s) => (p === 0 ? [] : [s]));
    const covering = this.sets.filter((part) => support.every((s) => part.states.includes(s)));
    return covering.length ? covering : this.sets;
  }

  act(belief) {
    return this.actions[this.evaluate(belief)[1]];
  }

  /** Return the distribution of the shared values under a belief. */
  marginal(belief) {
    const mass = new Array(this.domain.values.length).fill(0);
    this.planner.value_of.forEach((v, s) => {
      if (v >= 0) mass[v] += belief[s];
    });
    const total = add(mass);
    return mass.map((p) => (total > 0 ? p / total : 1 / mass.length));
  }

  /**
   * Return what the page shows of a belief before the action that the policy chooses there: the values of all
   * actions one step ahead, and the outcomes of the chosen one. A terminal belief has no action.
   * chosen: the action, by default of the policy. follow: returns the action after an observation.
   */
  view(belief, chosen = this.act(belief), follow = null) {
    const known = { belief: this.listBelief(belief), shared: this.marginal(belief) };
    if (this.isTerminal(belief)) {
      return { ...known, action: null, done: true, report: null, values: [], outcomes: [], fan: null };
    }
    const report = this.reports[chosen];
    const values = [];
    const outcomes = [];
    for (const action of this.actions) {
      let value = belief.reduce((sum, p, s) => sum + p * this.planner.R[action][s], 0);
      for (const { o, probability, belief: after } of this.split(belief, action)) {
        if (probability < MIN_OUTCOME || this.isTerminal(after)) continue;
        const [future, following] = this.evaluate(after);
        value += this.planner.discount * probability * future;
        if (action === chosen && report === null) {
          const observation = this.domain.observations[o];
          const shared = this.marginal(after);
          const next = follow === null ? this.actions[following] : follow(observation);
          outcomes.push({ observation, probability, action: next, shared });
        }
      }
      values.push({ action, value });
    }
    values.sort((a, b) => b.value - a.value);
    return { ...known, action: chosen, done: report !== null, report, values, outcomes, fan: this.drawFan(belief) };
  }

  listBelief(belief) {
    return Object.fromEntries(belief.flatMap((p, s) => (p === 0 ? [] : [[this.planner.states[s], p]])));
  }

  /** Return the alpha vectors over two or three shared values that are best somewhere; null otherwise. */
  drawFan(belief) {
    const n = this.domain.values.length;
    if (n !== 2 && n !== 3) return null;
    const corners = this.findCorners(belief);
    const lines = this.sets.flatMap((part) => this.restrict(part, corners));
    const heights = Float64Array.from(lines.flatMap((line) => line.values));
    const best = new Set(makeGrid(n).map((point) => findBest(heights, point)));
    return lines.filter((_, k) => best.has(k));
  }

  /** Return the belief given each shared value; the initial one for a value of probability 0. */
  findCorners(belief) {
    return this.domain.values.map((_, v) => {
      const own = belief.map((p, s) => (this.planner.value_of[s] === v ? p : 0));
      const total = add(own);
      return total > 0 ? own.map((p) => p / total) : this.planner.initial_states[v];
    });
  }

  restrict(part, corners) {
    const isInside = corners.every((corner) => corner.every((p, s) => p === 0 || part.states.includes(s)));
    if (!isInside) return [];
    const n = part.states.length;
    return part.actions.map((a, k) => ({
      action: this.actions[a],
      values: corners.map((corner) => part.states.reduce((sum, s, i) => sum + part.vectors[k * n + i] * corner[s], 0)),
    }));
  }
}

function add(values) {
  return values.reduce((sum, value) => sum + value, 0);
}

function makeGrid(n) {
  const points = [];
  if (n === 2) {
    for (let i = 0; i <= LINE_STEPS; i += 1) points.push([1 - i / LINE_STEPS, i / LINE_STEPS]);
    return points;
  }
  for (let i = 0; i <= TRIANGLE_STEPS; i += 1) {
    for (let j = 0; j <= TRIANGLE_STEPS - i; j += 1) {
      points.push([i, j, TRIANGLE_STEPS - i - j].map((k) => k / TRIANGLE_STEPS));
    }
  }
  return points;
}

/** Return the number of the vector that is highest at a point; heights: of each vector at the corners. */
function findBest(heights, point) {
  const n = point.length;
  let best = 0;
  let top = -Infinity;
  for (let begin = 0; begin < heights.length; begin += n) {
    let height = 0;
    for (let v = 0; v < n; v += 1) height += heights[begin + v] * point[v];
    if (height > top) {
      top = height;
      best = begin / n;
    }
  }
  return best;
}
