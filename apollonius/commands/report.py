"""`apollonius report`: a training run or a reproduction as one HTML page."""

import argparse
from pathlib import Path
from typing import Any

from apollonius.commands.options import finish
from apollonius.commands.values import existing_folder, new_file
from apollonius.errors import require
from apollonius.extras import require_extra


def add_report(subparsers: Any) -> None:
    parser = subparsers.add_parser("report", help="a training run or a reproduction as one HTML page, games included")
    parser.add_argument(
        "folder", type=existing_folder, metavar="RUN", help="folder of a training run or a reproduction"
    )
    parser.add_argument("--out", type=new_file(".html"), help="file to write, .html (default: RUN/report.html)")
    parser.set_defaults(run=run_report)


def run_report(options: argparse.Namespace) -> int:
    folder: Path = options.folder
    out: Path = options.out or folder / "report.html"
    require_extra("plot", "report")
    from apollonius.show.report.page import save_page
    from apollonius.show.report.study import study_page
    from apollonius.show.report.training import training_page

    is_study = (folder / "results.json").is_file()
    is_run = (folder / "config.toml").is_file()
    unfinished = any(folder.glob("seed-*/*/config.toml"))
    bound = "finished" if unfinished else "the folder of a training run or a reproduction"
    remedy = "go on with apollonius reproduce and --resume" if unfinished else "check the path"
    require(is_study or is_run, "RUN", folder, f"{bound}; {remedy}")
    options.display.begin("playing games and drawing", compiles=True)
    page = study_page(folder) if is_study else training_page(folder)
    save_page(page, out)
    options.display.end()
    finish(out, then=f"open {out} in a browser")
    return 0
