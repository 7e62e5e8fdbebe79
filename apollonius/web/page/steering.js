// Actions of people: keys held down, fingers or a mouse on pads of nine actions.

import { make } from "./files.js";
import { EVADER, HOLD, PURSUER, clip } from "./game.js";

const KEYS = {
  arrows: { ArrowUp: [1, 0], ArrowDown: [-1, 0], ArrowLeft: [0, 1], ArrowRight: [0, -1] },
  letters: { KeyW: [1, 0], KeyS: [-1, 0], KeyA: [0, 1], KeyD: [0, -1] },
};
const ALL_KEYS = Object.assign({}, ...Object.values(KEYS));
const OF_SIDE = { [PURSUER]: KEYS.letters, [EVADER]: KEYS.arrows }; // with two people

export class Steering {
  constructor() {
    this.held = new Set();
    this.release();
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

  /**
   * The action a person chooses for a robot. With two people, arrows steer the evader and letters the pursuer, and each has
   * a pad.
   */
  action(role, together) {
    if (this.pads[role] !== null) return this.pads[role];
    const keys = together ? OF_SIDE[role] : ALL_KEYS;
    const pressed = [...this.held].filter((code) => code in keys).map((code) => keys[code]);
    const level = (axis) => Math.sign(pressed.reduce((sum, push) => sum + push[axis], 0));
    return HOLD + 3 * level(0) + level(1); // Eq. 5
  }

  /** Make an element of nine cells a robot's pad: rows speed up, hold, brake; columns turn left, straight, right. */
  attach(element, role) {
    for (const arrow of "↖↑↗←•→↙↓↘") element.append(make("span", {}, arrow));
    const choose = (event) => {
      const box = element.getBoundingClientRect();
      const third = (offset, length) => clip(Math.floor((3 * offset) / length), 0, 2);
      this.pads[role] = 8 - 3 * third(event.clientY - box.top, box.height) - third(event.clientX - box.left, box.width);
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
