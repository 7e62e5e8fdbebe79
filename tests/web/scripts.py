"""What tests ask of the page in any browser: where the arena lies on it, and to take files that are dropped."""

PLACING = """async arena => {
  const canvas = document.getElementById("canvas");
  const { placing } = await import("./draw.js");
  const { left, top } = canvas.getBoundingClientRect();
  return { ...placing(canvas, arena), left, top, ratio: devicePixelRatio };
}"""
"""Where an arena of these limits [m] lies, in pixels of the canvas, and where that lies in the window [px]."""
DROP = """files => {
  const dataTransfer = new DataTransfer();
  for (const [name, base64] of files) {
    dataTransfer.items.add(new File([Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0))], name));
  }
  document.body.dispatchEvent(new DragEvent("drop", { dataTransfer, bubbles: true, cancelable: true }));
}"""
"""Drop files, pairs of a name and what is in it as base64."""


def spot(placing, x, y):
    """The place [px] in the window of a place in the arena [m]."""
    right, down = placing["x"] + placing["scale"] * x, placing["y"] - placing["scale"] * y
    return placing["left"] + right / placing["ratio"], placing["top"] + down / placing["ratio"]
