"""The report of a training run: its numbers and games, nothing from outside, and what is missing in words."""

import json
import os
import re
import shutil
from dataclasses import replace
from html import unescape

import pytest

from apollonius.cli.main import main
from apollonius.evaluate.claims import paper_shares
from apollonius.evaluate.match import Match
from apollonius.evaluate.pairings import last_agents, pairings
from apollonius.game.outcome import PURSUER_FAILS, PURSUER_WINS
from apollonius.game.presets import make_game
from apollonius.game.types import Outcome
from apollonius.io.errors import InvalidInput
from apollonius.show import report as report_module
from apollonius.show.report import MAX_BYTES, SEED, bundle, games_to_show, render, report_of, save_report
from tests.documents import REPOSITORY
from tests.web.browser import needs_chromium

GAMES = 24
"""Of each pairing."""


class Document:
    """The words of a report, and its embedded games."""

    def __init__(self, html):
        bare = re.sub(r"<(script|style).*?</\1>", "", html, flags=re.DOTALL)
        self.text = " ".join(unescape(re.sub("<[^>]*>", " ", bare)).split())
        self.games = json.loads(found[1]) if (found := re.search('id="replays">(.*?)</script>', html)) else []


@pytest.fixture(scope="module", autouse=True)
def page(demo):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(report_module, "GAMES", GAMES)
        yield report_of(demo)


@pytest.fixture(scope="module")
def document(page):
    return Document(render(page))


@pytest.fixture
def copy(demo, tmp_path):
    return shutil.copytree(demo, tmp_path / "copy")


def test_report_needs_nothing_from_outside(page, tmp_path):
    html = render(page)
    links = re.findall('(?:src|href|data|action)="([^"]*)"', html)
    assert links
    assert all(link.startswith(("data:", "#")) for link in links)
    assert not re.search(r"https?:|@import|url\((?!#)", html)
    assert "default-src 'none'" in html
    script = bundle(REPOSITORY / "apollonius" / "show" / "replay.js")
    assert len(script) < 17_000
    assert not re.search(r"import |</|/\*\*", script)
    save_report(page, tmp_path / "report.html")
    assert (tmp_path / "report.html").read_text() == html
    assert (tmp_path / "report.html").stat().st_size < MAX_BYTES


def test_report_shows_the_numbers_of_the_run_beside_the_paper(document, demo):
    match = json.loads((demo / "evaluation.json").read_text())["P_curriculum against random"]
    assert f"{100 * match['pursuer_win_rate']:.1f} % won by the pursuer (the paper: 93.0 %)" in document.text
    for outcome, count in match["outcomes"].items():
        assert f"{outcome.replace('_', ' ')} {count:,} {100 * (count / match['games']):.1f} %" in document.text
    assert re.search(r"captured [\d,]+ [\d.]+ % 12.4 %", document.text)
    last = json.loads((demo / "metrics.jsonl").read_text().splitlines()[-1])
    assert f"{last['env_steps']:,}" in document.text
    assert f"{last['episodes']:,}" in document.text
    assert " ".join((demo / "config.toml").read_text().split()) in document.text
    assert "demo/P_curriculum against random" in document.text, "not the zoo's agent of that name"
    assert "Not " not in document.text
    assert sum(paper_shares("P_curriculum", "random").values()) == pytest.approx(1)
    assert paper_shares("P_curriculum", "still") == {}
    for label in ("games [%]", "mean reward of a game", "mean loss of an update", "env steps"):
        assert document.text.count(label) >= 2


def test_report_shows_games_of_the_agents_of_the_run_worst_first(document, demo):
    agents, games = last_agents(demo), document.games
    assert pairings(agents) == [("P_curriculum", "random"), ("P_curriculum", "E_curriculum"), ("P_stage1", "still")]
    shown = [tuple(f"demo/{name}" if name in agents else name for name in names) for names in pairings(agents)]
    assert list(dict.fromkeys((one["pursuer"], one["evader"]) for one in games)) == shown
    times = [int(count) for count in re.findall(rf"(\d+) of {GAMES}", document.text)]
    lengths = re.findall(rf"([\d.]+) s · \d+ of {GAMES}", document.text)
    assert lengths == [f"{(len(one['states']) - 1) / 10:.1f}" for one in games]
    for ours in shown:
        own = [index for index, one in enumerate(games) if (one["pursuer"], one["evader"]) == ours]
        outcomes = [Outcome[games[index]["outcome"].upper()] for index in own]
        ranks = [0 if one in PURSUER_FAILS else 2 if one in PURSUER_WINS else 1 for one in outcomes]
        assert ranks == sorted(ranks)
        assert len(set(outcomes)) == len(outcomes)
        assert sum(times[index] for index in own) == GAMES, "every way in which they end"


def test_report_explains_falling_curves_of_self_play(document):
    fixed, self_play = document.text.split("Learning: ")[-2:]
    assert "the pursuer's wins fall while the evader improves faster" in self_play
    assert "improves faster" not in fixed


def test_report_escapes_names_and_configs(page):
    """A name cannot end the script, nor begin an element."""
    name, config = "P_<b onclick=x>'&", "# </pre><script>alert(1)</script>\n"
    games = [(replace(replay, pursuer=name), times) for replay, times in page["games"]]
    html = render(page | {"games": games, "config": config})
    document = Document(html)
    assert html.count("<b ") == 0
    assert html.count("<script") == 2
    assert f"{name} against random" in document.text
    assert document.games[0]["pursuer"] == name


@pytest.mark.parametrize("chunks", [0, 2])
def test_report_of_an_unfinished_run_says_so(copy, chunks):
    lines = (copy / "metrics.jsonl").read_text().splitlines(keepends=True)[:chunks]
    (copy / "metrics.jsonl").write_text("".join(lines))
    (copy / "evaluation.json").unlink()
    shutil.rmtree(copy / "agents")
    page = report_of(copy)
    told = Document(render(page)).text
    done = f"{json.loads(lines[-1])['env_steps']:,}" if lines else "0"
    assert f"Not finished: fixed-target stands at {done} of " in told
    assert "Go on with: apollonius resume" in told
    assert "Not finished: self-play stands at 0 of " in told
    assert "Not judged" in told
    assert "No games" in told
    assert not page["games"]


def test_report_command_writes_into_the_run(copy, capsys):
    for path in copy.glob("agents/*_curriculum.safetensors"):
        path.unlink()
    assert main(["report", str(copy)]) == 0
    assert f"wrote {copy / 'report.html'} (" in capsys.readouterr().err
    assert Document((copy / "report.html").read_text()).games


@pytest.mark.parametrize(
    ("name", "make"),
    [
        ("evaluation.json", lambda to, old: to.write_text('{"a against b": {"games": 3}}')),
        (
            "evaluation.json",
            lambda to, old: to.write_text(old.read_text().replace(" against ", " against a against ")),
        ),
        ("metrics.jsonl", lambda to, old: os.mkfifo(to)),
        ("evaluation.json", lambda to, old: to.symlink_to("/dev/zero")),
        ("config.toml", lambda to, old: to.symlink_to(shutil.copy(old, to.parents[1] / to.name))),
    ],
)
def test_damaged_run_is_refused_in_one_line(copy, capsys, name, make):
    """Not even a whole file of that name beside the folder counts."""
    make(copy / name, (copy / name).rename(copy / "moved"))
    before = sorted(copy.rglob("*"))
    assert main(["report", str(copy)]) == 2
    said = capsys.readouterr().err
    assert said.startswith("apollonius report: ")
    assert said.count("\n") == 1
    assert sorted(copy.rglob("*")) == before


def test_games_too_long_for_a_report_are_refused():
    with pytest.raises(InvalidInput, match=r"steps of a game that a report shows = 50001 .*at most 50,000"):
        games_to_show(Match.of_names(replace(make_game("paper"), max_steps=50_001), "still", "still", GAMES, SEED))


def test_report_too_large_to_send_is_refused(page, tmp_path, monkeypatch):
    monkeypatch.setattr(report_module, "MAX_BYTES", 1000)
    with pytest.raises(InvalidInput, match="at most 1,000"):
        save_report(page, tmp_path / "report.html")
    assert not list(tmp_path.iterdir())


@needs_chromium
def test_report_games_play_in_a_browser(page, tmp_path, browser):
    save_report(page, tmp_path / "report.html")
    complaints, tab = [], browser.new_page()
    tab.on("console", lambda message: complaints.append(message.text))
    tab.on("pageerror", lambda error: complaints.append(str(error)))
    tab.goto((tmp_path / "report.html").as_uri())
    replay, _ = page["games"][0]
    seconds = f"{len(replay.actions) * replay.game.dt:.1f} s"
    assert tab.inner_text("[data-part=clock]") == f"{seconds} of {seconds}"
    assert tab.inner_text("[data-part=outcome]").endswith(f" after {seconds}")
    pixels = "document.querySelector('canvas').toDataURL()"
    ended = tab.evaluate(pixels)
    tab.fill("[data-part=seek]", "0")
    assert tab.evaluate(pixels) != ended
    tab.close()
    assert complaints == []
