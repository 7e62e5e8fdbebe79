// The way from the game to the workshop and back. The workshop is loaded when it is first wanted.

import { inLink } from "./files.js";

const DRAWN = "drawn"; // what the arena of this page's person is called among the games

export class Drawing {
  /**
   * @param element finds a part of the page by its id
   * @param session that is interrupted, and whose catalogue gets the drawn game
   * @param choices offer it
   */
  constructor(element, session, choices) {
    Object.assign(this, { element, session, choices, workshop: null });
    for (const type of ["dragover", "drop"]) document.addEventListener(type, (event) => event.preventDefault());
    document.addEventListener("drop", ({ dataTransfer }) => dataTransfer?.files.length && this.openFile(dataTransfer.files[0]));
  }

  /** Open the workshop with the arena of the game that is played. */
  async open() {
    await this.#begin();
    const { teams: _teams, ...game } = this.session.match?.game ?? this.session.catalogue.games.paper; // a game of two
    this.workshop.open(game);
  }

  async openFile(file) {
    if (!this.workshop?.editor.game) await this.open();
    else await this.#begin();
    await this.workshop.openFile(file);
  }

  async #begin() {
    this.workshop ??= new (await import("./workshop.js")).Workshop(this.element);
    this.session.enter("drawing");
  }

  /** Draw the workshop's frame. */
  draw(colours) {
    this.workshop.draw(colours);
  }

  /** Hear a key; returns whether it was one of the workshop's. */
  key(event) {
    return this.workshop.key(event);
  }

  /** Play in the arena as it is drawn, with players that know any. */
  play() {
    this.offer(this.workshop.game);
    this.session.begin(this.choices.read());
  }

  /** Put a drawn game among the others, and choose it. */
  offer(game) {
    const { map, ...arena } = game.arena;
    const record = { ...game, arena: { ...arena, map: map && { file: map.file, sha256: map.sha256 } } };
    const named = map ? { ...game, record } : game;
    const { catalogue } = this.session;
    this.session.catalogue = { ...catalogue, games: { ...catalogue.games, [DRAWN]: named } };
    this.choices.addGame(DRAWN, named);
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
