// A worker that surveys arenas, so that drawing never waits: a game in, with the number of the question; out come a quick
// survey and then the whole one.

import { survey } from "./survey.js";

const QUICK = 120; // cells along the longer side

globalThis.addEventListener("message", ({ data: { number, game } }) => {
  globalThis.postMessage({ number, isWhole: false, found: survey(game, QUICK) });
  globalThis.postMessage({ number, isWhole: true, found: survey(game) });
});
