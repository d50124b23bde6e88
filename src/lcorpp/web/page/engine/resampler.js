// A track at a fixed rate from samples as they arrive: the TrackResampler of the library, without lateness.

const SAME_TIME = 1e-6;
const JUMP_TOLERANCE = 0.1;
const MAX_NUMBER = 1e9;

export class TrackResampler {
  /** rules: {rate, max_gap, max_duration, max_speed}: points per second, seconds, seconds, metres per second. */
  constructor(rules) {
    this.rules = rules;
    this.last = null;
    this.latest = 0;
    this.begin = 0;
    this.elapsed = 0;
    this.next = 0;
    this.trackCount = 0;
    this.points = [];
    this.isNew = false;
  }

  get pointCount() {
    return this.last === null ? 0 : this.next;
  }

  /** Add a sample [time, x, y]; `takePoints` returns the points that it completes. */
  add([time, x, y]) {
    if (!(Math.abs(x) <= MAX_NUMBER && Math.abs(y) <= MAX_NUMBER)) return;
    if (this.last === null) {
      this.latest = time;
    } else if (time < this.latest - this.rules.max_gap) {
      this.last = null;
      this.latest = time;
    }
    this.latest = Math.max(this.latest, time);
    if (this.last === null || time - this.begin > this.elapsed) this.use(time, [x, y]);
  }

  /** Return [points since the last call, whether they begin a new track]. */
  takePoints() {
    const taken = [this.points, this.isNew];
    this.points = [];
    this.isNew = false;
    return taken;
  }

  use(time, sample) {
    const elapsed = time - this.begin;
    if (this.last === null || this.isBroken(sample, elapsed)) {
      this.trackCount += 1;
      this.begin = time;
      this.elapsed = 0;
      this.last = sample;
      this.next = 1;
      this.points = [sample];
      this.isNew = true;
      return;
    }
    const gap = elapsed - this.elapsed;
    let due = this.next / this.rules.rate;
    while (elapsed >= due - SAME_TIME) {
      const weight = elapsed <= due ? 1 : (due - this.elapsed) / gap;
      this.points.push(this.last.map((start, i) => start * (1 - weight) + sample[i] * weight));
      this.next += 1;
      due = this.next / this.rules.rate;
    }
    this.last = sample;
    this.elapsed = elapsed;
  }

  isBroken(sample, elapsed) {
    const gap = elapsed - this.elapsed;
    const distance = Math.hypot(sample[0] - this.last[0], sample[1] - this.last[1]);
    return (
      gap > this.rules.max_gap ||
      distance > this.rules.max_speed * (gap + JUMP_TOLERANCE) ||
      elapsed > this.rules.max_duration
    );
  }
}
