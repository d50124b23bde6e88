// How the person on the stage moves: towards a point, or as a prepared walk. Metres and seconds; all positions
// are whole centimetres, so that the address of the page can repeat a walk exactly. The numbers are those of
// the simulated people, lcorpp/domains/intention/walking.py.

export const TICK = 0.1;
export const START = [4.2, 8.4];
export const MAX_SECONDS = 55;
export const HALL = { left: -5.5, right: 5.5, bottom: -0.75, top: 9 };

const WALKING_SPEED = 1.3;
const APPROACH_SPEED = 0.5;
const RELAXATION_TIME = 0.6;
const BRAKING_TIME = 1.6;
const STOP = [0.35, 0.95];
const DECISION_DISTANCE = 7.5;
const PAUSE = { distance: 4.6, seconds: 2.5 };
const LANE_END = [-5.3, 2.3];
const MAX_STEPS = 400;

/** Prepared walks: name -> label and a function that returns the positions of a walk, a tick apart. */
export const WALKS = {
  pass: { label: "Pass by", make: makePassingWalk },
  come: { label: "Come", make: () => makeApproach(0) },
  hesitate: { label: "Hesitate", make: () => makeApproach(PAUSE.seconds) },
};

/** Return the next position on the way to a target, at most at a speed (metres a second), inside the hall. */
export function stepTowards([x, y], [tx, ty], speed) {
  const distance = Math.hypot(tx - x, ty - y);
  const share = distance === 0 ? 0 : Math.min(1, (speed * TICK) / distance);
  return toCentimetres([
    Math.min(HALL.right, Math.max(HALL.left, x + share * (tx - x))),
    Math.min(HALL.top, Math.max(HALL.bottom, y + share * (ty - y))),
  ]);
}

function makePassingWalk() {
  const path = [START];
  while (path.length < MAX_STEPS && path.at(-1)[0] > LANE_END[0] + 0.05) {
    path.push(stepTowards(path.at(-1), LANE_END, 1.05 * WALKING_SPEED));
  }
  return path;
}

/** Return the walk of a person who decides on the way to come, and who may stand still for some seconds. */
function makeApproach(pauseSeconds) {
  let position = START;
  let speed = WALKING_SPEED;
  let pause = pauseSeconds;
  const path = [toCentimetres(position)];
  while (path.length < MAX_STEPS) {
    const rest = Math.hypot(STOP[0] - position[0], STOP[1] - position[1]);
    if (rest < 0.04) break;
    const distance = Math.hypot(...position);
    const isPausing = distance < PAUSE.distance && pause > 0;
    if (isPausing) pause -= TICK;
    const wanted = distance < DECISION_DISTANCE ? APPROACH_SPEED : WALKING_SPEED;
    const desired = isPausing ? 0 : Math.min(wanted, rest / BRAKING_TIME + 0.1);
    speed += ((desired - speed) * TICK) / RELAXATION_TIME;
    const share = Math.min(1, (speed * TICK) / rest);
    position = position.map((own, i) => own + share * (STOP[i] - own)); // exact: a slow step is not whole centimetres
    path.push(toCentimetres(position));
  }
  return path;
}

function toCentimetres(position) {
  return position.map((metres) => Math.round(100 * metres) / 100);
}
