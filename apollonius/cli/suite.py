"""`apollonius suite`: judge an agent by the benchmark, and check the cards of others."""

import argparse
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from apollonius.cli.options import AGENT, add_json, add_workers, answer, command, finish, jobs_run
from apollonius.cli.values import existing_file, known_entrant, new_file
from apollonius.evaluate.names import PANELS
from apollonius.io.errors import require
from apollonius.io.limits import ENTRANTS

if TYPE_CHECKING:
    from apollonius.evaluate.suite_card import SuiteCard


def add_suite(parser: argparse.ArgumentParser) -> None:
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    judged = actions.add_parser("judge", help="play all games of the benchmark and write a card")
    judged.add_argument("agent", type=known_entrant, metavar="AGENT", help=f"{AGENT}; or a .py or .onnx file")
    judged.add_argument("--side", choices=("pursuer", "evader"), help="of an agent from outside, or that plays either")
    judged.add_argument("--track", choices=PANELS, default="full", help="the benchmark's part (default: %(default)s)")
    judged.add_argument(
        "--out", type=new_file(".json"), default=Path("card.json"), help="file to write, a new one (default: card.json)"
    )
    add_workers(judged, "rounds", None)
    judged.set_defaults(run=run_judge)
    checked = actions.add_parser("verify", help="play games of a card again, and refuse one that does not come out")
    checked.add_argument("card", type=existing_file, metavar="CARD")
    checked.add_argument("--agent", type=known_entrant, metavar="FILE", help="of an agent that lies elsewhere")
    checked.add_argument("--all", action="store_true", help="play all its games (default: half, drawn at random)")
    checked.set_defaults(run=run_verify)
    for action in (judged, checked):
        about = "interpreter that runs a .py or .onnx file (default: the one that runs this)"
        action.add_argument("--python", type=existing_file, default=Path(sys.executable), help=about)
        add_json(action)


def run_judge(options: argparse.Namespace) -> int:
    from apollonius.evaluate.benchmark import Benchmark
    from apollonius.evaluate.suite_card import judge
    from apollonius.export.player import side_of
    from apollonius.game.types import Role
    from apollonius.io.document import to_json, write_atomically

    require(not options.out.exists(), "--out", options.out, "a new file; choose another name")
    outside = options.agent.endswith(ENTRANTS)
    require(options.side or not outside, "--side", None, "given for an agent from outside: pursuer or evader")
    role = Role[options.side.upper()] if outside else side_of(options.agent, options.side)
    options.display.begin("playing the benchmark", compiles=True)
    asked_for = Benchmark(options.track, role), options.agent, str(options.python.absolute())
    card = judge(*asked_for, options.display.report, jobs_run(options))
    write_atomically(options.out, to_json(asdict(card)).encode())
    _answer(options, card)
    finish(options.out, then=command("suite", "verify", options.out), json=options.json)
    return 0


def run_verify(options: argparse.Namespace) -> int:
    from apollonius.evaluate.suite_card import verify

    options.display.begin("playing games of the card", compiles=True)
    card = verify(options.card, options.agent, str(options.python.absolute()), options.all, options.display.report)
    _answer(options, card, "it comes out: ")
    return 0


def _answer(options: argparse.Namespace, card: "SuiteCard", before: str = "") -> None:
    score = card.score
    text = (
        f"{before}{card.agent} ({card.side}, {card.track}): {score.worth:+.3f} [{score.interval[0]:+.3f}, "
        f"{score.interval[1]:+.3f}] against {score.against}, worst tenth {score.worst_tenth:+.3f}, "
        f"crashes {score.crashes:.1%}, forfeits {score.forfeits:.1%}, {card.decision_us:.4g} us a decision"
    )
    facts = {"agent": card.agent, "side": card.side, "track": card.track, "decision_us": card.decision_us}
    answer(options, facts | asdict(score), text + (f"\nit failed: {card.failure}" if card.failure else ""))
