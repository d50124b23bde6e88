// The current class probabilities of one person from samples as they arrive.

import { TrackResampler } from "./resampler.js";
import { MotionFeatures } from "./motion.js";
import { Lstm } from "./lstm.js";

export class Stream {
  /** classifier: of the model, a sense of tracks. */
  constructor(classifier) {
    this.classifier = classifier;
    this.resampler = new TrackResampler(classifier.rules);
    this.network = new Lstm(classifier.units, classifier.weights);
    this.motion = null;
    this.probabilities = null;
  }

  get points() {
    return this.resampler.pointCount;
  }

  get track() {
    return this.resampler.trackCount;
  }

  /** Add samples [time, x, y], in any order. */
  push(samples) {
    for (const sample of samples) this.resampler.add(sample);
    const [points, isNew] = this.resampler.takePoints();
    if (isNew) {
      this.motion = new MotionFeatures(this.classifier.motion);
      this.network.reset();
    }
    const { mean, scale, rules } = this.classifier;
    for (const point of points) {
      const features = this.motion.advance(point).map((value, i) => (value - mean[i]) / scale[i]);
      this.probabilities = this.network.advance(features);
    }
    if (this.points < rules.min_points) this.probabilities = null;
  }

  /** The predicted class; null before the first prediction. */
  get class() {
    if (this.probabilities === null) return null;
    const { classes, threshold } = this.classifier;
    let candidates = this.probabilities;
    if (threshold !== null) {
      const column = classes.indexOf(threshold.name);
      if (candidates[column] >= threshold.probability) return threshold.name;
      candidates = candidates.map((p, k) => (k === column ? -1 : p));
    }
    return classes[indexOfMaximum(candidates)];
  }
}

/** A track whose classifier runs in the host, see session.js. */
export class HostStream {
  constructor(host, sense) {
    this.host = host;
    this.sense = sense;
    Object.assign(this, { points: 0, track: 0, probabilities: null, class: null });
  }

  async push(samples) {
    Object.assign(this, await this.host.classify(this.sense, samples));
  }
}

/** Return the index of the largest number, the first of equals. */
export function indexOfMaximum(values) {
  let best = 0;
  for (let i = 1; i < values.length; i += 1) if (values[i] > values[best]) best = i;
  return best;
}
