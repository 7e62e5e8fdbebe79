// What a person wants the robot to do: keys held down, or a finger or mouse on the pad of nine gears.

import { EVADER, PURSUER } from "./rules.js";

export const HOLD = 4; // keep the speed, go straight

const KEYS = {
  arrows: { ArrowUp: [1, 0], ArrowDown: [-1, 0], ArrowLeft: [0, 1], ArrowRight: [0, -1] },
  letters: { KeyW: [1, 0], KeyS: [-1, 0], KeyA: [0, 1], KeyD: [0, -1] },
};

/** The action of two gears, each -1, 0 or 1: `3 * i_u1 + i_u2` (Eq. 5). */
const asAction = (u1, u2) => 3 * (u1 + 1) + (u2 + 1);

export class Steering {
  constructor() {
    this.held = new Set();
    this.pad = null;
  }

  /** Whether a key steers; it is then held or let go. */
  key(code, isDown) {
    if (!(code in KEYS.arrows) && !(code in KEYS.letters)) return false;
    if (isDown) this.held.add(code);
    else this.held.delete(code);
    return true;
  }

  /** Let go of everything, as when the page is left. */
  release() {
    this.held.clear();
    this.pad = null;
  }

  /** The action a person chooses for a robot; with two people, arrows steer the evader and letters the pursuer. */
  action(role, together) {
    if (this.pad !== null && !together) return this.pad;
    const sets = { [PURSUER]: [KEYS.letters], [EVADER]: [KEYS.arrows] };
    const keys = Object.assign({}, ...(together ? sets[role] : Object.values(KEYS)));
    const pressed = [...this.held].filter((code) => code in keys).map((code) => keys[code]);
    const gear = (axis) => Math.sign(pressed.reduce((sum, push) => sum + push[axis], 0));
    return asAction(gear(0), gear(1));
  }

  /** Make an element of nine cells a pad: rows speed up, hold, brake; columns turn left, straight, right. */
  attach(element) {
    const choose = (event) => {
      const box = element.getBoundingClientRect();
      const third = (offset, length) => Math.min(2, Math.max(0, Math.floor((3 * offset) / length)));
      this.pad = asAction(1 - third(event.clientY - box.top, box.height), 1 - third(event.clientX - box.left, box.width));
      event.preventDefault();
    };
    element.addEventListener("pointerdown", (event) => {
      element.setPointerCapture(event.pointerId);
      choose(event);
    });
    element.addEventListener("pointermove", (event) => event.buttons && choose(event));
    for (const end of ["pointerup", "pointercancel"]) element.addEventListener(end, () => (this.pad = null));
  }
}
