"""`python -m website`: the site as a static folder, which works on any web host and opened as
files.
"""

import argparse
import shutil
import subprocess
import sys
from pathlib import Path

from apollonius.cli.main import main as apollonius
from website.playground import write_playground
from website.reference import write_reference
from website.sources import HERE, REPOSITORY, write_sources


def main() -> int:
    """Write the site; returns an exit status."""
    parser = argparse.ArgumentParser(prog="python -m website", description=__doc__)
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("build/site"),
        help="folder to write (default: %(default)s)",
    )
    out: Path = parser.parse_args().out.resolve()
    work = out.with_name(f"{out.name}-sources")
    shutil.rmtree(out, ignore_errors=True)
    print("the documents, the gallery, the reference", flush=True)
    write_sources(work)
    write_reference(work / "reference")
    options = [
        "--builder",
        "html",
        "--fail-on-warning",
        "--keep-going",
        "--quiet",
        "--jobs",
        "auto",
    ]
    folders = ["--conf-dir", str(HERE), "--doctree-dir", str(work / "doctrees")]
    sphinx = subprocess.run(
        [sys.executable, "-m", "sphinx", *options, *folders, str(work), str(out)], check=False
    )
    if sphinx.returncode:
        return sphinx.returncode  # it has said why
    # a template that the theme leaves there
    (out / "_static" / "webpack-macros.html").unlink(missing_ok=True)
    print("the playground", flush=True)
    write_playground(out / "playground")
    print("the report", flush=True)
    apollonius(
        [
            "report",
            str(REPOSITORY / "docs/results/demo"),
            "--out",
            str(out / "reports" / "demo.html"),
        ]
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
