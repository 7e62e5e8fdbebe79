// What is shown of a match in every frame: the arena, the clock, the slow replay, the pads' pressed cells.

import { between, coloursOf, draw } from "./draw.js";
import { fogOf } from "./fog.js";
import { isActive, robotOf } from "./game.js";
import { known, layersOf } from "./why.js";

export class Stage {
  /** @param element finds a part of the page by its id; `steering` knows which cells of pads are pressed */
  constructor(element, steering) {
    Object.assign(this, { element, steering, layers: [], known: {} });
    const look = () => (this.colours = coloursOf(document.documentElement));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", look);
    look();
  }

  /** Draw a session as it is at a time [s]. Robots are drawn one step late, between the last two states, to move smoothly. */
  show(session, now) {
    const { element, colours } = this;
    const { phase, time, ending, people, choice } = session;
    const match = session.seen ?? session.match;
    const replayed = ending && !session.seen ? ending.at(now) : match.states.length - 1;
    const isReplaying = replayed < match.states.length - 1;
    const states = isReplaying ? match.states.slice(0, Math.floor(replayed) + 2) : match.states;
    const [before, after] = states.slice(-2);
    const share = isReplaying ? replayed % 1 : phase === "over" ? 1 : time / match.game.dt;
    const own = people.map((role) => ({ role, number: 0 })).filter((who) => isActive(robotOf(match.state, who)));
    const fog = fogOf(match, session.me);
    const layers = this.layers.length && !isReplaying && !fog ? layersOf(match, this.#knownOf(match), colours) : null;
    draw(element("canvas"), {
      game: match.game,
      states: isReplaying ? states.slice(0, -1) : states,
      now: after && phase !== "ready" ? between(before, after, share) : match.state,
      colours,
      steered: match.isOver ? [] : own,
      layers,
      fog,
    });
    if (ending) this.#showEnding(session, now);
    element("clock").textContent = (choice.level?.isEndless ? match.seconds : Math.max(0, match.secondsLeft)).toFixed(1);
    if (phase === "playing") for (const role of people) this.#press(role, people.length === 2);
  }

  /** What the layers show of a match now, worked out once for each of its states. */
  #knownOf({ game, state, states, players }) {
    if (this.known.state !== state || this.known.layers !== this.layers) {
      const values = (who) => robotOf(players, who).values?.(game, state, who, states) ?? null;
      this.known = { state, layers: this.layers, found: known(game, states, this.layers, values) };
    }
    return this.known.found;
  }

  /** Show the moment of the slow replay. */
  #showEnding({ ending, lostAt }, now) {
    const { element } = this;
    const at = ending.at(now);
    const when = `${(at * ending.match.game.dt).toFixed(1)}\u00a0s`;
    Object.assign(element("moment"), { max: ending.last, value: Math.round(at), ariaValueText: when });
    element("when").textContent = when;
    element("mark").hidden = lostAt === null;
    element("mark").style.setProperty("--at", lostAt / ending.last);
  }

  #press(role, together) {
    const action = this.steering.action(role, together);
    const cell = 3 * (2 - Math.floor(action / 3)) + (2 - (action % 3));
    [...this.element(`pad-${role}`).children].forEach((span, index) => span.classList.toggle("on", index === cell));
  }
}
