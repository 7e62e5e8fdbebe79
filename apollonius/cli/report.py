"""`apollonius report`: a training run as one HTML page."""

import argparse
from pathlib import Path

from apollonius.cli.options import finish
from apollonius.cli.values import new_file, run_folder
from apollonius.io.errors import require_extra


def add_report(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("folder", type=run_folder, metavar="RUN", help="folder of a training run")
    parser.add_argument("--out", type=new_file(".html"), help="file to write, .html (default: RUN/report.html)")
    parser.set_defaults(run=run_report)


def run_report(options: argparse.Namespace) -> int:
    folder: Path = options.folder
    out: Path = options.out or folder / "report.html"
    require_extra("plot", "report")
    from apollonius.show.report import report_of, save_report

    options.display.begin("playing games and drawing", compiles=True)
    save_report(report_of(folder), out)
    options.display.end()
    finish(out, then=f"open {out} in a browser")
    return 0
