// Games as the JSON that `--game` reads, and the same in a link: text in, a checked game out, and back.

import { gameFrom } from "./validation.js";

const MARK = "#game=";
const LONGEST = 100_000; // characters of a link's game, decoded

/** The game of a JSON text; `map` is the one it names, loaded. Throws an Error in one line. */
export function readGame(text, map = null) {
  const said = parsed(text);
  const named = said?.arena?.map;
  if (named !== undefined && !map) {
    throw new Error(`this game is on the map ${String(named?.file ?? named).slice(0, 60)}: drop its .yaml and its image together with it`);
  }
  return gameFrom(said, map);
}

function parsed(text) {
  try {
    return JSON.parse(text);
  } catch (error) {
    throw new Error(error.message.replace(/\s+/g, " ").slice(0, 120));
  }
}

/** A game as JSON; a map by the name of its YAML file, which lies beside it. */
export function writeGame(game, indent = 2) {
  const { map, ...arena } = game.arena;
  return JSON.stringify({ ...game, arena: map ? { ...arena, map: map.file } : arena }, null, indent);
}

/** What stands after the address in a link to a game: its JSON in base64url. Games on maps are too large for links. */
export function asFragment(game) {
  if (game.arena.map) throw new Error("a map is too large for a link: save the game and send its files");
  const bytes = new TextEncoder().encode(writeGame(game, 0));
  const letters = btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(""));
  return MARK + letters.replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "");
}

/** The game of a link's fragment, or null where it has none. Throws an Error in one line. */
export function fromFragment(fragment) {
  if (!fragment.startsWith(MARK)) return null;
  const letters = fragment.slice(MARK.length);
  if (letters.length > (4 / 3) * LONGEST) throw new Error("it is too long");
  let text;
  try {
    const bytes = Uint8Array.from(atob(letters.replaceAll("-", "+").replaceAll("_", "/")), (letter) => letter.charCodeAt(0));
    text = new TextDecoder("utf-8", { fatal: true }).decode(bytes);
  } catch {
    throw new Error("it is damaged; copy the whole link");
  }
  return readGame(text);
}
