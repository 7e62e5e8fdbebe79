// Opened from a folder, a page may import no module and fetch no file. Here both come from plain scripts beside it, which
// hold the same bytes: modules become blobs that import one another, and `fetch` answers with what a script has brought.

const arrivals = new Map();
const answers = new Map();

function load(script) {
  const element = document.createElement("script");
  element.src = `offline/${script}.js`;
  document.head.append(element);
  return element;
}

function bring(path) {
  return new Promise((resolve, reject) => {
    arrivals.set(path, resolve);
    load(path.replaceAll("/", "-")).onerror = () => reject(new TypeError(`${path} is not in this folder`));
  });
}

globalThis.fetch = async (path) => {
  if (!answers.has(path)) answers.set(path, bring(path));
  return (await answers.get(path)).clone();
};

globalThis.apolloniusFile = (path, base64) => {
  arrivals.get(path)(new Response(Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0))));
};

/** Pairs of a module's name and its source, each after those that it imports. */
globalThis.apolloniusModules = (modules) => {
  const addresses = new Map();
  for (const [name, source] of modules) {
    const bound = source.replace(/((?:from|import)\s*\(?)"\.\/([^"]+)"/g, (_, word, other) => `${word}"${addresses.get(other)}"`);
    addresses.set(name, URL.createObjectURL(new Blob([bound], { type: "text/javascript" })));
  }
  import([...addresses.values()].at(-1));
};

addEventListener("DOMContentLoaded", () => load("modules"));
