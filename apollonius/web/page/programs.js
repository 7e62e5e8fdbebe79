// The functions of `compiled.js`, which are those of the package, and the memory that they read and write.
//
// An argument has one place in memory under its name, whichever function it is for. `given.robots()` are typed arrays of
// its leaves, or one of an array, to be filled in before a call; numbers are arguments of the call itself. They are asked for
// each time, as what they show moves when memory grows. A result of an argument's name is written in its place.

import { LAYOUTS, MODULE } from "./compiled.js";

const KINDS = { float32: Float32Array, int32: Int32Array, uint16: Uint16Array, uint32: Uint32Array };
const PAGE = 2 ** 16; // unit in which memory grows [bytes]

const module = new WebAssembly.Module(Uint8Array.from(atob(MODULE), (letter) => letter.charCodeAt(0)));
const { exports } = new WebAssembly.Instance(module, {});
const { memory } = exports;
let end = exports.__heap_base.value;

/** Reserve some bytes; returns their address. */
function allocate(bytes) {
  const at = Math.ceil(end / 16) * 16;
  end = at + bytes;
  if (end > memory.buffer.byteLength) memory.grow(Math.ceil((end - memory.buffer.byteLength) / PAGE));
  return at;
}

/** Addresses of arguments; the page sets those of arrays of any length, a map's field and weights. */
export const addresses = { field: 0, weights: 0 };

/** The address of a copy of some arrays of numbers, one after the other. */
export function kept(arrays) {
  const all = Float32Array.from(arrays.flatMap((array) => Array.from(array)));
  const at = allocate(all.byteLength);
  new Float32Array(memory.buffer, at, all.length).set(all);
  return at;
}

/** Typed arrays of the leaves of a record that lies at an address, or the one of an array. */
function viewsOf(leaves, at) {
  let [views, buffer] = [null, null];
  const view = ([, kind, size, offset]) => new KINDS[kind](memory.buffer, at + offset, size);
  return () => {
    if (buffer !== memory.buffer) {
      views = leaves[0][0] ? Object.fromEntries(leaves.map((leaf) => [leaf[0], view(leaf)])) : view(leaves[0]);
      ({ buffer } = memory);
    }
    return views;
  };
}

export const given = {};
for (const [name, [bytes, leaves]] of Object.entries(LAYOUTS.given)) {
  if (name in addresses) continue;
  addresses[name] = allocate(bytes);
  given[name] = viewsOf(leaves, addresses[name]);
}

/** A function of a module: from the numbers among its arguments to its result, or to its results by their names. */
function bound(call, [takes, results]) {
  const ends = Object.entries(results).map(([key, [bytes]]) => addresses[key] ?? allocate(bytes));
  const views = Object.entries(results).map(([key, [, leaves]], index) => [key, viewsOf(leaves, ends[index])]);
  const found = Object.fromEntries(views);
  return (...numbers) => {
    let next = 0;
    call(...takes.map((one) => addresses[one] ?? numbers[next++]), ...ends);
    return found.result?.() ?? found;
  };
}

export const run = Object.fromEntries(Object.entries(LAYOUTS.functions).map(([name, layout]) => [name, bound(exports[name], layout)]));

const [OWN, OWN_END] = [2 ** 26, 2 ** 26 + 2 ** 23]; // where a user's own module has its constants and its stack

/** The player in a user's own module (`apollonius/web/programs.py`): from numbers to its action. There is room for one. */
export function ownProgram(bytes) {
  if (end > OWN) throw new Error("there is no room for another player of your own: reload the page");
  allocate(OWN_END - end);
  const { own } = new WebAssembly.Instance(new WebAssembly.Module(bytes), { env: { memory } }).exports;
  return bound(own, [LAYOUTS.functions.intercept[0], { result: [4, [["", "int32", 1, 0]]] }]);
}
