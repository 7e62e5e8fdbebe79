// Files that the page loads when it is first asked for, as the fields of maps, games from a catalogue, and what it makes:
// elements, links, files that a person saves.

import { inTeams, partsOf } from "./game.js";

const read = new Map();

/** Read a file by a function of its bytes, once. `name` is for messages. */
export async function load(name, path, reads) {
  if (!read.has(path)) {
    const answer = await fetch(path);
    if (!answer.ok) throw new Error(`${name} cannot be loaded (${answer.status})`);
    read.set(path, reads(await answer.arrayBuffer()));
  }
  return read.get(path);
}

/** A game, such as `office` or `team-3v1/office`. */
export async function findGame({ games, maps }, name) {
  const [found, counts] = partsOf(name, games);
  const game = games[found];
  const withMap = (buffer) => {
    const map = { ...maps[found], ...game.arena.map, field: new Float32Array(buffer) };
    return { ...game, arena: { ...game.arena, map } };
  };
  const whole = maps[found] ? await load(`the map of ${found}`, maps[found].field, withMap) : game;
  return counts ? inTeams(whole, ...counts) : whole;
}

/** A game as replays have it: of its map the file and the digest. */
export function asRecord(game) {
  const { map, ...arena } = game.arena;
  return map ? { ...game, arena: { ...arena, map: { file: map.file, sha256: map.sha256 } } } : game;
}

/** An element of a kind, with its properties and what is inside. */
export function make(kind, properties = {}, ...inside) {
  const made = Object.assign(document.createElement(kind), properties);
  made.append(...inside);
  return made;
}

/** Let a person save a text, or bytes, as a file. */
export function saveAs(name, content, type) {
  const href = URL.createObjectURL(new Blob([content], { type }));
  make("a", { href, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(href), 1000);
}

/** Copy a link, and put it into the address bar. */
export async function copyLink(url) {
  history.replaceState(null, "", url);
  await navigator.clipboard?.writeText(url).catch(() => null);
}
