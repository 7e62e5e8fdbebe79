// Actions of people: keys held down, fingers or a mouse on pads of nine actions, game controllers.

import { make } from "./files.js";
import { EVADER, PURSUER, clip } from "./game.js";

const KEYS = {
  arrows: { ArrowUp: [1, 0], ArrowDown: [-1, 0], ArrowLeft: [0, 1], ArrowRight: [0, -1] },
  letters: { KeyW: [1, 0], KeyS: [-1, 0], KeyA: [0, 1], KeyD: [0, -1] },
};
const ALL_KEYS = Object.assign({}, ...Object.values(KEYS));
const OF_SIDE = { [PURSUER]: KEYS.letters, [EVADER]: KEYS.arrows }; // with two people

// Of a controller: the stick or the cross steers, triggers or shoulders speed up and brake, a face button starts.
const DEAD = 0.4; // of a stick's way, within which it counts as let go
const [CROSS_UP, CROSS_DOWN, CROSS_LEFT, CROSS_RIGHT] = [12, 13, 14, 15];
const BRAKES = [4, 6];
const THRUSTS = [5, 7];
const STARTS = [9, 0];

/** The action of two levels, each -1, 0 or 1: `3 * i_u1 + i_u2` (Eq. 5). */
const asAction = (u1, u2) => 3 * (u1 + 1) + (u2 + 1);

const plugged = () => [...(navigator.getGamepads?.() ?? [])].filter((pad) => pad?.connected);

/** Return the two levels that a controller asks for, -1, 0 or 1 each. */
function askedBy({ axes, buttons }) {
  const pressed = (...indices) => indices.some((index) => buttons[index]?.pressed);
  const push = (axis) => (Math.abs(axes[axis] ?? 0) > DEAD ? Math.sign(axes[axis]) : 0);
  const thrust = pressed(CROSS_UP, ...THRUSTS) - pressed(CROSS_DOWN, ...BRAKES) || -push(1);
  const turn = pressed(CROSS_LEFT) - pressed(CROSS_RIGHT) || -push(0);
  return [thrust, turn];
}

export class Steering {
  constructor() {
    this.held = new Set();
    this.wasPressed = false;
    this.pads = { [PURSUER]: null, [EVADER]: null };
  }

  /** Press or release a key; returns whether it steers. */
  key(code, isDown) {
    if (!(code in ALL_KEYS)) return false;
    if (isDown) this.held.add(code);
    else this.held.delete(code);
    return true;
  }

  /** Let go of everything, as when the page is left. */
  release() {
    this.held.clear();
    this.pads = { [PURSUER]: null, [EVADER]: null };
  }

  /** Return whether a start button has just been pressed on any controller; asked once a frame. */
  starts() {
    const isPressed = plugged().some(({ buttons }) => STARTS.some((index) => buttons[index]?.pressed));
    const isNew = isPressed && !this.wasPressed;
    this.wasPressed = isPressed;
    return isNew;
  }

  /**
   * The action a person chooses for a robot. With two people, arrows steer the evader and letters the pursuer, each has
   * a pad, and of two controllers the first is the pursuer's; one alone is the evader's.
   */
  action(role, together) {
    if (this.pads[role] !== null) return this.pads[role];
    const keys = together ? OF_SIDE[role] : ALL_KEYS;
    const pressed = [...this.held].filter((code) => code in keys).map((code) => keys[code]);
    const controllers = plugged();
    const own = !together ? controllers : role === PURSUER ? controllers.slice(0, -1) : controllers.slice(-1);
    const pushes = [...pressed, ...own.map(askedBy)];
    const level = (axis) => Math.sign(pushes.reduce((sum, push) => sum + push[axis], 0));
    return asAction(level(0), level(1));
  }

  /** Make an element of nine cells a robot's pad: rows speed up, hold, brake; columns turn left, straight, right. */
  attach(element, role) {
    for (const arrow of "↖↑↗←•→↙↓↘") element.append(make("span", {}, arrow));
    const choose = (event) => {
      const box = element.getBoundingClientRect();
      const third = (offset, length) => clip(Math.floor((3 * offset) / length), 0, 2);
      this.pads[role] = asAction(
        1 - third(event.clientY - box.top, box.height),
        1 - third(event.clientX - box.left, box.width),
      );
      event.preventDefault();
    };
    element.addEventListener("pointerdown", (event) => {
      element.setPointerCapture(event.pointerId);
      choose(event);
    });
    element.addEventListener("pointermove", (event) => event.buttons && choose(event));
    for (const end of ["pointerup", "pointercancel"]) element.addEventListener(end, () => (this.pads[role] = null));
  }
}
