"""Modules as one script: each before those that ask for it, once, and without its comments."""

import shutil
import subprocess

import pytest

from apollonius.show.report.page import replay_script
from apollonius.show.report.script import bundled

MODULES = {
    "top.js": """// Says something.
import { twice as two } from "./deep/middle.js";
import { BASE, Box } from "./base.js";

/** What there is. */
export const said = [two(BASE), new Box(BASE).held];
console.log(JSON.stringify(said));
""",
    "deep/middle.js": """import { BASE } from "../base.js";

const factor = 2; // stays
/**
 * Over two lines.
 */
export function twice(number) {
  return factor * number + BASE;
}
export function* never() {}
""",
    "base.js": """console.log("base");
export const BASE = 20;
export class Box {
  constructor(held) {
    this.held = held;
  }
}
""",
}


@pytest.mark.skipif(not shutil.which("node"), reason="needs node")
def test_modules_become_one(tmp_path):
    (tmp_path / "deep").mkdir()
    for name, text in MODULES.items():
        (tmp_path / name).write_text(text)
    script = bundled(tmp_path / "top.js")
    (tmp_path / "all.mjs").write_text(script)
    done = subprocess.run(["node", tmp_path / "all.mjs"], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.splitlines() == ["base", "[60,20]"]
    assert "Over two" not in script
    assert "// stays" in script


def test_the_player_of_games_is_small_and_imports_nothing():
    script = replay_script()
    assert len(script) < 60_000
    assert "import " not in script
    assert "</" not in script
