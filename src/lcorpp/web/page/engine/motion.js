// Motion features of a track of positions, point by point; docs/guides/learning/features.md describes each.

const MIN_SPEED = 0.1;
const START_DISTANCE = 0.5;

export class MotionFeatures {
  /** motion: {features, rate, robot: [x, y, heading]}. */
  constructor(motion) {
    this.features = motion.features;
    this.rate = motion.rate;
    this.robot = motion.robot;
    this.first = null;
    this.start = null;
    this.previous = null;
    this.earlier = null;
  }

  /** Return the features of the next point [x, y], in the order of their rows. */
  advance(point) {
    this.first = this.first ?? point;
    if (this.start === null || length(subtract(this.start, this.first)) < START_DISTANCE) this.start = point;
    const now = this.describe(point, this.previous ?? point);
    const before = this.describe(this.previous ?? point, this.earlier ?? this.previous ?? point);
    const rows = this.features.flatMap((name) => this.compute(name, now, before));
    this.earlier = this.previous;
    this.previous = point;
    return rows;
  }

  /** Return what the features need of a point and its predecessor, in the robot's frame. */
  describe(point, previous) {
    const increment = this.rotate(subtract(point, previous));
    return {
      position: this.rotate(subtract(point, this.robot)),
      displacement: this.rotate(subtract(point, this.first)),
      heading: normalize(increment),
      velocity: length(increment) * this.rate,
    };
  }

  compute(name, now, before) {
    const position = now.position;
    const own = () =>
      rotateRelative(now.displacement, normalize(this.rotate(subtract(this.start, this.first))));
    switch (name) {
      case "x":
        return [now.displacement[0]];
      case "y":
        return [now.displacement[1]];
      case "velocity":
        return [now.velocity];
      case "heading":
        return now.heading;
      case "acceleration":
        return [this.earlier === null ? 0 : (now.velocity - before.velocity) * this.rate];
      case "turn_rate": {
        const isStanding = Math.min(now.velocity, before.velocity) <= MIN_SPEED;
        return [isStanding ? 0 : angleBetween(now.heading, before.heading) * this.rate];
      }
      case "ahead":
        return [own()[0]];
      case "left":
        return [own()[1]];
      case "approach":
        return rotateRelative(now.heading, normalize([-position[0], -position[1]]));
      case "distance":
        return [length(position)];
      case "distance_rate":
        return [(length(position) - length(before.position)) * this.rate];
      case "bearing":
        return normalize(position);
      case "bearing_rate":
        return [angleBetween(position, before.position) * this.rate];
      default:
        throw new Error(`unknown feature ${name}`);
    }
  }

  rotate([x, y]) {
    const cosine = Math.cos(this.robot[2]);
    const sine = Math.sin(this.robot[2]);
    return [cosine * x + sine * y, cosine * y - sine * x];
  }
}

function subtract(end, start) {
  return [end[0] - start[0], end[1] - start[1]];
}

function length([x, y]) {
  return Math.hypot(x, y);
}

function normalize(vector) {
  const size = length(vector);
  return size > 0 ? [vector[0] / size, vector[1] / size] : vector;
}

function rotateRelative([dx, dy], [rx, ry]) {
  return [rx * dx + ry * dy, rx * dy - ry * dx];
}

function angleBetween(direction, reference) {
  const [cosine, sine] = rotateRelative(direction, reference);
  return Math.atan2(sine, cosine);
}
