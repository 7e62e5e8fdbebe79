// Actions of people: keys held down, fingers or a mouse on pads of nine actions, game controllers.

import { EVADER, PURSUER } from "./game.js";

const KEYS = {
  arrows: { ArrowUp: [1, 0], ArrowDown: [-1, 0], ArrowLeft: [0, 1], ArrowRight: [0, -1] },
  letters: { KeyW: [1, 0], KeyS: [-1, 0], KeyA: [0, 1], KeyD: [0, -1] },
};
const ALL_KEYS = Object.assign({}, ...Object.values(KEYS));
const OF_SIDE = { [PURSUER]: KEYS.letters, [EVADER]: KEYS.arrows }; // with two people

/** The action of two gears, each -1, 0 or 1: `3 * i_u1 + i_u2` (Eq. 5). */
const asAction = (u1, u2) => 3 * (u1 + 1) + (u2 + 1);

export class Steering {
  /** @param controllers asked once a step for the gears of each that is plugged in */
  constructor(controllers = { gears: () => [] }) {
    this.controllers = controllers;
    this.held = new Set();
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

  /**
   * The action a person chooses for a robot. With two people, arrows steer the evader and letters the pursuer, each has
   * a pad, and of two controllers the first is the pursuer's.
   */
  action(role, together) {
    if (this.pads[role] !== null) return this.pads[role];
    const keys = together ? OF_SIDE[role] : ALL_KEYS;
    const pressed = [...this.held].filter((code) => code in keys).map((code) => keys[code]);
    const gear = (axis) => Math.sign(pressed.reduce((sum, push) => sum + push[axis], 0));
    const asked = this.controllers.gears();
    const own = together && asked.length > 1 ? [asked[role === PURSUER ? 0 : 1]] : together && role === PURSUER ? [] : asked;
    const held = pressed.length ? null : own.find((gears) => gears !== null && gears !== undefined);
    return held ? asAction(...held) : asAction(gear(0), gear(1));
  }

  /** Make an element of nine cells a robot's pad: rows speed up, hold, brake; columns turn left, straight, right. */
  attach(element, role) {
    const choose = (event) => {
      const box = element.getBoundingClientRect();
      const third = (offset, length) => Math.min(2, Math.max(0, Math.floor((3 * offset) / length)));
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
