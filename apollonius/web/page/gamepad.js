// Game controllers: a stick or the cross steers, triggers or shoulders speed up and brake, a face button starts.

const DEAD = 0.4; // of a stick's way, within which it counts as let go
const [CROSS_UP, CROSS_DOWN, CROSS_LEFT, CROSS_RIGHT] = [12, 13, 14, 15];
const BRAKES = [4, 6];
const THRUSTS = [5, 7];
const [START, FACE] = [9, 0];

/** Return the two levels that a controller asks for, -1, 0 or 1 each, or null for none. */
function gearsOf({ axes, buttons }) {
  const pressed = (...indices) => indices.some((index) => buttons[index]?.pressed);
  const push = (axis) => (Math.abs(axes[axis] ?? 0) > DEAD ? Math.sign(axes[axis]) : 0);
  const thrust = pressed(CROSS_UP, ...THRUSTS) - pressed(CROSS_DOWN, ...BRAKES) || -push(1);
  const turn = pressed(CROSS_LEFT) - pressed(CROSS_RIGHT) || -push(0);
  return thrust || turn ? [thrust + 0, turn + 0] : null; // never minus nothing
}

/** The controllers that are plugged in, looked at once a frame. */
export class Controllers {
  constructor() {
    this.wasPressed = false;
  }

  /** Return the levels of each, in their order. */
  gears() {
    return this.#plugged().map(gearsOf);
  }

  /** Return whether a start button has just been pressed on any. */
  starts() {
    const isPressed = this.#plugged().some(({ buttons }) => buttons[START]?.pressed || buttons[FACE]?.pressed);
    const isNew = isPressed && !this.wasPressed;
    this.wasPressed = isPressed;
    return isNew;
  }

  #plugged() {
    return [...(navigator.getGamepads?.() ?? [])].filter((pad) => pad?.connected);
  }
}
