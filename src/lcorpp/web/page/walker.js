// The person's legs: pointer, keys and prepared walks become positions, one a tick.

import { HALL, MAX_SECONDS, START, TICK, WALKS, stepTowards } from "./walks.js";

const KEYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1], " ": [0, 0] };
const KEY_SPEED = 1.3;
const SLOW_SPEED = 0.5;
const MAX_SPEED = 2;
const URGE = 1.2;

export class Walker {
  /** onMove: takes the positions so far after each tick. onEnd: called when the person stops. prepared: name of the walk. */
  constructor(onMove, onEnd) {
    this.onMove = onMove;
    this.onEnd = onEnd;
    this.timer = null;
    this.keys = new Set();
    this.isSlow = false;
    this.reset();
  }

  get position() {
    return this.path.at(-1) ?? START;
  }

  get isWalking() {
    return this.timer !== null;
  }

  reset() {
    this.halt();
    this.path = [];
    this.prepared = null;
    this.isLocked = false;
  }

  /** Let the person no longer move: the robot decides. */
  lock() {
    this.halt();
    this.isLocked = true;
  }

  /** Walk as prepared, in real time, or at once. */
  play(name, atOnce) {
    const rest = [...WALKS[name].make()];
    this.prepared = name;
    if (atOnce) this.follow(rest);
    else this.go(() => rest.shift() ?? null);
  }

  /** Take all positions of a path at once. */
  follow(path) {
    this.halt();
    this.path = [...path];
    this.onMove(this.path);
    this.onEnd();
  }

  /** Walk towards a point, the slower the nearer, until `halt`. */
  head(target) {
    this.target = [Math.min(HALL.right, Math.max(HALL.left, target[0])), target[1]];
    if (this.isHeading) return;
    this.begin();
    this.go(() => {
      const distance = Math.hypot(this.target[0] - this.position[0], this.target[1] - this.position[1]);
      return stepTowards(this.position, this.target, Math.min(MAX_SPEED, URGE * distance));
    });
    this.isHeading = true;
  }

  /** Take a key that goes down; return whether it is one for walking. */
  press(key, isSlow) {
    if (!Object.hasOwn(KEYS, key) || this.isLocked) return false;
    this.isSlow = isSlow;
    const isFirst = this.keys.size === 0;
    this.keys.add(key);
    if (isFirst) {
      this.begin();
      this.go(() => this.stepByKeys());
    }
    return true;
  }

  /** Take a key that goes up, or all of them (null). */
  release(key, isSlow) {
    this.isSlow = isSlow;
    const wasPressed = this.keys.size > 0;
    if (key === null) this.keys.clear();
    else this.keys.delete(key);
    if (wasPressed && this.keys.size === 0) this.halt();
  }

  /** Stand where walks begin, unless the person already walked. */
  begin() {
    this.prepared = null;
    if (this.path.length === 0) this.path.push(START);
  }

  stepByKeys() {
    const [dx, dy] = [...this.keys].reduce(([x, y], key) => [x + KEYS[key][0], y + KEYS[key][1]], [0, 0]);
    const target = [this.position[0] + 9 * dx, this.position[1] + 9 * dy];
    return stepTowards(this.position, target, this.isSlow ? SLOW_SPEED : KEY_SPEED);
  }

  /** Move every tick to what `next` returns, until it returns null. */
  go(next) {
    if (this.isLocked) return;
    clearInterval(this.timer);
    this.isHeading = false;
    const move = () => {
      const position = this.path.length * TICK > MAX_SECONDS ? null : next();
      if (position === null) {
        this.halt();
        return;
      }
      this.path.push(position);
      this.onMove(this.path);
    };
    this.timer = setInterval(move, 1000 * TICK);
    move();
  }

  halt() {
    const wasWalking = this.isWalking;
    clearInterval(this.timer);
    this.timer = null;
    this.target = null;
    this.isHeading = false;
    this.keys.clear();
    if (wasWalking) this.onEnd();
  }
}
