// Files that the page loads when it is first asked for, as the fields of maps, games from a catalogue, and
// those that it lets a person save.

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

/** Return whether an agent is a user's own player, and no network. */
export const isOwn = ({ files }, name) => files[name]?.endsWith(".wasm");

/** A game, such as `office` or `team-3v1/office`. */
export async function findGame(catalogue, name) {
  const [arena, counts] = partsOf(name, catalogue.games);
  const game = await findArena(catalogue, arena);
  return counts ? inTeams(game, ...counts) : game;
}

async function findArena({ games, maps }, name) {
  const game = games[name];
  if (!maps[name]) return game;
  return load(`the map of ${name}`, maps[name].field, (buffer) => {
    const map = { ...maps[name], ...game.arena.map, field: new Float32Array(buffer) };
    return { ...game, arena: { ...game.arena, map } };
  });
}

/** A game as replays have it: of its map the file and the digest. */
export function asRecord(game) {
  const { map, ...arena } = game.arena;
  return map ? { ...game, arena: { ...arena, map: { file: map.file, sha256: map.sha256 } } } : game;
}

/** Let a person save a text, or bytes, as a file. */
export function saveAs(name, content, type) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([content], { type }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
