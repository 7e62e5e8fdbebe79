// What `arena check` says of the arena that is drawn, asked of a worker so that drawing never waits: of the latest arena,
// once the one before is done.

import { QUICK, survey } from "./survey.js";

export class Surveying {
  /** @param onFound called with what `survey` finds, first by a coarse grid and then by a fine one */
  constructor(onFound) {
    Object.assign(this, { onFound, asked: null, wanted: null, isOutdated: false });
    this.worker = new Worker(new URL("./surveyor.js", import.meta.url), { type: "module" });
    this.worker.addEventListener("message", ({ data }) => this.#hear(data));
    this.worker.addEventListener("error", () => this.#goOnAlone()); // as for pages that are opened from a folder
  }

  /** Survey a game's arena; null to forget the one that was asked for. */
  ask(game) {
    [this.wanted, this.isOutdated] = [game, true];
    this.#next();
  }

  #next() {
    if (this.asked || !this.wanted) return;
    [this.asked, this.wanted, this.isOutdated] = [this.wanted, null, false];
    this.worker.postMessage(this.asked);
  }

  #hear({ isWhole, found }) {
    if (!this.isOutdated) this.onFound(found);
    if (!isWhole) return;
    this.asked = null;
    this.#next();
  }

  #goOnAlone() {
    const postMessage = (game) => setTimeout(() => this.#hear({ isWhole: true, found: survey(game, QUICK) }));
    this.worker = { postMessage };
    if (this.asked) postMessage(this.asked);
  }
}
