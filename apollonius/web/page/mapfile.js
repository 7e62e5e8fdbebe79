// Occupancy maps from what a person drops on the page: the YAML and image that ROS's map_server writes, or any picture.
// The field of distances is that of `game/occupancy.py`, what a file says is read as by `arenas/map_file.py`.

import { chessboard, euclidean } from "./distances.js";

const MOST_CELLS = 2000; // along a side
const OF_PICTURE = 400; // cells along the longer side of a picture's map
const LENGTH = 12; // of that side [m]
const NEEDED = ["image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh"];
const DARK = 0.5; // a picture's cell as dark as this is occupied

function refuse(name, value, bound) {
  throw new Error(`${name} = ${String(value).slice(0, 60)} is not possible: it must be ${bound}`);
}

/** The values of a map's YAML file: a key and a value in each line, as map_server writes them. */
export function readYaml(text) {
  const said = {};
  for (const line of text.split(/\r?\n/)) {
    const found = line.match(/^([A-Za-z_]\w*)\s*:\s*(.*?)\s*(?:#.*)?$/);
    if (found) said[found[1]] = found[2].replace(/^(["'])(.*)\1$/, "$2");
  }
  for (const key of NEEDED) if (!Object.hasOwn(said, key)) refuse(`map: ${key}`, "missing", "given, as map_server wants it");
  const number = (key, value = said[key]) => {
    const found = value.trim() === "" ? Number.NaN : Number(value);
    return Math.abs(found) <= 1e6 ? found : refuse(`map: ${key}`, value, "a number within 1e6 of 0");
  };
  const [resolution, negate, occupied, free] = ["resolution", "negate", "occupied_thresh", "free_thresh"].map((key) => number(key));
  const places = said.origin.replace(/^\[|\]$/g, "").split(",");
  if (places.length !== 3) refuse("map: origin", said.origin, "[x, y, yaw] of the lower left corner");
  const [x, y, yaw] = places.map((place) => number("origin", place));
  if (yaw !== 0) refuse("map: origin, yaw", yaw, "0, as walls lie along x and y");
  if (!(resolution > 0 && resolution <= 1e3)) refuse("map: resolution", resolution, "metres in a cell, more than 0");
  if (negate !== 0 && negate !== 1) refuse("map: negate", negate, "0 (dark is occupied) or 1");
  if (!(free > 0 && free <= occupied && occupied <= 1)) refuse("map: free_thresh", free, "above 0, up to occupied_thresh");
  if ((said.mode ?? "trinary") !== "trinary") refuse("map: mode", said.mode, "trinary");
  return { image: said.image, resolution, x, y, negate, free };
}

/** The grey values of a PGM image, from 0 to 1, the first row at the top: {columns, rows, grey}. */
export function readPgm(bytes) {
  let at = 0;
  const word = () => {
    const isBlank = () => bytes[at] <= 32 || bytes[at] === 35;
    while (at < bytes.length && isBlank()) {
      if (bytes[at] === 35) while (at < bytes.length && bytes[at] !== 10) at += 1;
      else at += 1;
    }
    let text = "";
    while (at < bytes.length && !isBlank()) text += String.fromCharCode(bytes[at++]);
    return text;
  };
  const kind = word();
  if (kind !== "P5" && kind !== "P2") refuse("map: image", `of kind ${kind}`, "a PGM or PNG file");
  const [columns, rows, most] = [word(), word(), word()].map(Number);
  checkSize(columns, rows);
  if (!(most >= 1 && most <= 65535)) refuse("map: image", `with values up to ${most}`, "one with values up to 255 or 65535");
  at += 1;
  const wide = most > 255 ? 2 : 1;
  if (kind === "P5" && bytes.length < at + wide * columns * rows) refuse("map: image", "cut off", "whole; copy it again");
  const raw = (index) => (wide === 2 ? 256 * bytes[at + 2 * index] + bytes[at + 2 * index + 1] : bytes[at + index]);
  const value = kind === "P2" ? () => Number(word()) : raw;
  const white = most > 255 ? 65535 : 255;
  const grey = Float32Array.from({ length: rows * columns }, (_, index) => Math.round((value(index) * white) / most) / white);
  return { columns, rows, grey };
}

function checkSize(columns, rows) {
  const isSize = (count) => Number.isInteger(count) && count >= 1 && count <= MOST_CELLS;
  if (!isSize(columns) || !isSize(rows)) refuse("map: image", `${columns} x ${rows} cells`, `at most ${MOST_CELLS} along each side; crop it`);
}

/** The grey values of any picture that the browser reads, smaller if wanted; what is transparent is white. */
async function readPicture(blob, most) {
  const picture = await createImageBitmap(blob);
  const share = Math.min(1, most / Math.max(picture.width, picture.height));
  const [columns, rows] = [picture.width, picture.height].map((length) => Math.max(1, Math.round(length * share)));
  checkSize(columns, rows);
  const canvas = new OffscreenCanvas(columns, rows);
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.fillStyle = "white";
  context.fillRect(0, 0, columns, rows);
  context.drawImage(picture, 0, 0, columns, rows);
  const { data } = context.getImageData(0, 0, columns, rows);
  const grey = Float32Array.from({ length: rows * columns }, (_, cell) => {
    return (data[4 * cell] + data[4 * cell + 1] + data[4 * cell + 2]) / 3 / 255;
  });
  return { columns, rows, grey };
}

const isPgm = (bytes) => bytes[0] === 80 && (bytes[1] === 53 || bytes[1] === 50);

/** Which cells are occupied, row by row from the bottom, from an image whose first row is at the top. */
export function occupiedCells({ columns, rows, grey }, isFree) {
  const occupied = new Uint8Array(rows * columns);
  for (let row = 0; row < rows; row++) {
    for (let column = 0; column < columns; column++) {
      occupied[row * columns + column] = isFree(grey[(rows - 1 - row) * columns + column]) ? 0 : 1;
    }
  }
  return occupied;
}

/** The field of distances [m] at the corners of cells. */
export function distanceField(occupied, rows, columns, cell) {
  const corners = (wanted) => {
    const found = new Uint8Array((rows + 1) * (columns + 1));
    occupied.forEach((value, index) => {
      if (value !== wanted) return;
      const at = Math.floor(index / columns) * (columns + 1) + (index % columns);
      found[at] = found[at + 1] = found[at + columns + 1] = found[at + columns + 2] = 1;
    });
    return found;
  };
  if (occupied.every((value) => value === 1)) refuse("map", "all occupied", "one with free cells; mind negate and free_thresh");
  const size = Math.fround(cell);
  if (!occupied.includes(1)) return new Float32Array((rows + 1) * (columns + 1)).fill(Math.fround(Math.hypot(rows + 1, columns + 1)) * size);
  const [away, within] = [euclidean(corners(1), rows + 1, columns + 1), chessboard(corners(0), rows + 1, columns + 1)];
  return Float32Array.from(away, (length, index) => Math.fround(Math.fround(length) - within[index]) * size);
}

async function digestOf(...parts) {
  if (!globalThis.crypto?.subtle) return "";
  const all = new Uint8Array(parts.reduce((sum, part) => sum + part.length, 0));
  parts.reduce((at, part) => (all.set(part, at), at + part.length), 0);
  return [...new Uint8Array(await crypto.subtle.digest("SHA-256", all))].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}

/** The map of a YAML file and its image, both {name, bytes}. */
export async function mapOf(yaml, image) {
  const said = readYaml(new TextDecoder().decode(yaml.bytes));
  const read = isPgm(image.bytes) ? readPgm(image.bytes) : await readPicture(new Blob([image.bytes]), MOST_CELLS + 1);
  const darkness = (grey) => (said.negate ? grey : Math.fround(1 - grey));
  const occupied = occupiedCells(read, (grey) => darkness(Math.fround(grey)) < Math.fround(said.free));
  return asMap(read, occupied, said, yaml.name, await digestOf(yaml.bytes, image.bytes));
}

const asMap = ({ rows, columns }, occupied, { x, y, resolution }, file, digest) => {
  const field = distanceField(occupied, rows, columns, resolution);
  return { x, y, cell: resolution, rows: rows + 1, columns: columns + 1, field, file, digest };
};

/** The map of a picture, dark where it is occupied, with the two files that map_server reads: {map, files}. */
export async function mapOfPicture({ name, bytes }) {
  const read = isPgm(bytes) ? readPgm(bytes) : await readPicture(new Blob([bytes]), OF_PICTURE);
  const { columns, rows } = read;
  const occupied = occupiedCells(read, (grey) => 1 - grey < DARK);
  const resolution = Number((LENGTH / Math.max(columns, rows)).toPrecision(4));
  const stem = name.replace(/\.\w+$/, "").replace(/[^\w-]/g, "_") || "picture";
  const lines = [`image: "${stem}.pgm"`, `resolution: ${resolution}`, "origin: [0.0, 0.0, 0.0]", "negate: 0"];
  const yaml = new TextEncoder().encode([...lines, "occupied_thresh: 0.65", "free_thresh: 0.196", ""].join("\n"));
  const head = new TextEncoder().encode(`P5\n${columns} ${rows}\n255\n`);
  const pgm = new Uint8Array(head.length + rows * columns);
  pgm.set(head);
  occupied.forEach((value, index) => {
    pgm[head.length + (rows - 1 - Math.floor(index / columns)) * columns + (index % columns)] = value ? 0 : 254;
  });
  const map = asMap(read, occupied, { x: 0, y: 0, resolution }, `${stem}.yaml`, await digestOf(yaml, pgm));
  return { map, files: [{ name: `${stem}.yaml`, bytes: yaml }, { name: `${stem}.pgm`, bytes: pgm }] };
}
