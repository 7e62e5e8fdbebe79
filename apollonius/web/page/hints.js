// Hints of danger: how near the other is, and whether braking now would still do. Heard if wanted, felt on phones.

import { clearanceAlong } from "./clearance.js";
import { EVADER } from "./rules.js";
import { bodyOf, opponentOf, robotOf } from "./teams.js";

const ALARMED = 3; // distance [m] from the reach of a capture at which an evader begins to hear its pursuer
const [LOW, HIGH] = [220, 660]; // Hz
const [SELDOM, OFTEN] = [0.9, 0.16]; // between two beeps [s]
const BEEP = 0.07; // how long one lasts [s]
const LOUD = 0.06;

/** Where a robot would come to rest if it braked straight ahead now. */
export function restOf(body, robot) {
  const reach = robot.v ** 2 / (2 * Math.max(body.u1_max, 1e-6));
  return { ...robot, x: robot.x + reach * Math.cos(robot.heading), y: robot.y + reach * Math.sin(robot.heading) };
}

/** Whether a robot, {role, number}, that brakes straight ahead now touches something. */
export function isTooFast(game, who, robot) {
  const body = bodyOf(game, who);
  return clearanceAlong(game.arena, robot, restOf(body, robot)) < body.radius;
}

/** How near a capture by the nearest opponent is, from 0 to 1; who hunts has nothing to fear. */
export function nearness(game, state, who) {
  if (who.role !== EVADER) return 0;
  const [own, opponent] = [robotOf(state, who), opponentOf(state, who)];
  const away = Math.hypot(own.x - opponent.x, own.y - opponent.y) - game.capture_distance;
  return Math.min(1, Math.max(0, 1 - away / ALARMED));
}

/** Beeps and buzzes, the nearer the faster; silent until sound is switched on, as browsers want a press first. */
export class Alarm {
  constructor() {
    this.isMuted = true;
    this.next = 0;
    this.audio = null;
  }

  /** Switch the sound on or off. */
  mute(isMuted) {
    this.isMuted = isMuted;
    if (!isMuted) this.audio ??= globalThis.AudioContext ? new AudioContext() : null;
    this.audio?.resume?.();
  }

  /** Say how it stands: `near` from 0 to 1, whether the robot `isTooFast`, the time now [s]. */
  tell(near, isTooFast, now) {
    const danger = isTooFast ? 1 : near;
    if (danger === 0 || now < this.next) return;
    this.next = now + SELDOM + (OFTEN - SELDOM) * danger;
    if (!this.isMuted) this.#beep(LOW + (HIGH - LOW) * near, isTooFast ? "square" : "sine");
    if (danger > 0.6) navigator.vibrate?.(30);
  }

  #beep(frequency, type) {
    if (!this.audio) return;
    const { audio } = this;
    const [tone, volume] = [audio.createOscillator(), audio.createGain()];
    Object.assign(tone, { type });
    tone.frequency.value = frequency;
    volume.gain.setValueAtTime(LOUD, audio.currentTime);
    volume.gain.exponentialRampToValueAtTime(1e-4, audio.currentTime + BEEP);
    tone.connect(volume).connect(audio.destination);
    tone.start();
    tone.stop(audio.currentTime + BEEP);
  }
}
