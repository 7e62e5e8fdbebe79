// The way from the game to the workshop and back. The workshop is loaded when it is first wanted.

import { inLink } from "./files.js";

const DRAWN = "drawn"; // what the arena of this page's person is called among the games

export class Drawing {
  /**
   * @param element finds a part of the page by its id
   * @param page {catalogue, choices, match}
   * @param onOpen called when the workshop opens
   * @param onPlay called with the choice of a game in the drawn arena
   */
  constructor(element, page, onOpen, onPlay) {
    Object.assign(this, { element, page, onOpen, onPlay, workshop: null });
    for (const type of ["dragover", "drop"]) document.addEventListener(type, (event) => event.preventDefault());
    document.addEventListener("drop", ({ dataTransfer }) => dataTransfer?.files.length && this.openFiles(dataTransfer.files));
  }

  /** Open the workshop with the arena of the game that is played. */
  async open() {
    await this.#begin();
    this.workshop.open(this.page.match?.game ?? this.page.catalogue.games.paper, this.workshop.files);
  }

  async openFiles(files) {
    if (!this.workshop?.editor.game) await this.open();
    else await this.#begin();
    await this.workshop.openFiles(files);
  }

  async #begin() {
    this.workshop ??= new (await import("./workshop.js")).Workshop(this.element);
    this.onOpen();
  }

  /** Play in the arena as it is drawn, with players that know any. */
  play() {
    this.offer(this.workshop.game);
    this.onPlay({ ...this.page.choices.read(), level: null });
  }

  /** Put a drawn game among the others, and choose it. */
  offer(game) {
    const { map, ...arena } = game.arena;
    const record = { ...game, arena: { ...arena, map: map && { file: map.file, sha256: map.digest || null } } };
    const named = map ? { ...game, record } : game;
    this.page.catalogue = { ...this.page.catalogue, games: { ...this.page.catalogue.games, [DRAWN]: named } };
    this.page.choices.addGame(DRAWN, named);
  }

  /** Offer the game of a link's fragment, if it has one; returns what is wrong with it, or null. */
  async offerLinked(fragment) {
    try {
      const game = await inLink(fragment);
      if (game) this.offer(game);
      return null;
    } catch (error) {
      return `The arena in this link cannot be played: ${error.message}.`;
    }
  }
}
