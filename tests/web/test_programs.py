"""What the page runs is what the package says now."""

import subprocess
import sys
from pathlib import Path


def test_the_page_is_up_to_date():
    """In a process of its own, where types are not checked while programs run: that takes a hundred times as long."""
    command = [sys.executable, "-m", "website.compiled", "--check"]
    checked = subprocess.run(command, cwd=Path(__file__).parents[2], capture_output=True, text=True)
    assert checked.returncode == 0, checked.stderr
