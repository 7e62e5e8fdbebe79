// A worker that surveys arenas: a game in, out come a quick survey and then the whole one.

import { QUICK, survey } from "./survey.js";

globalThis.addEventListener("message", ({ data: game }) => {
  globalThis.postMessage({ isWhole: false, found: survey(game, QUICK) });
  globalThis.postMessage({ isWhole: true, found: survey(game) });
});
