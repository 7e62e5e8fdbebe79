"""The code in the documents runs; commands can be given as they stand there."""

import argparse
import ast
import importlib
import json
import re
import runpy
import tomllib
from importlib.util import find_spec
from pathlib import Path

import jax
import pytest
import tomli_w
import yaml

from apollonius.agents.built_in import PLAYERS
from apollonius.agents.names import SHIELDED, bare_name
from apollonius.agents.trained import zoo_names
from apollonius.arenas.file import find_game, split_team, to_dict
from apollonius.arenas.suite import is_scenario
from apollonius.cli import values
from apollonius.cli.main import main
from apollonius.io.limits import GAME_FILES
from apollonius.learn.config import RunConfig
from apollonius.learn.folder import load_config
from tests.arenas.test_file import room, write
from tests.documents import ALL, DOCUMENTS, LANGUAGES, PAGES, REPOSITORY, asides, blocks, name_of
from tests.learn.tiny import RUN

DOCS = REPOSITORY / "docs"
PLACEHOLDERS = {"N": "1", "S": "1", "SIDE": "pursuer", "HOST:PORT": "localhost:1"}
"""What stands in the text for a number or a choice."""
READERS_FILES = {"mine.onnx", "floor.toml", "hall.toml", "replays/game-41-pursuer_hit_obstacle.json"}
"""Files that commands take without the document saying how they are made: the reader's own, and a game's replay."""
TRAINED = re.compile(r"(?P<run>.+)/agents/[PE]_(stage1|curriculum|scratch|response)(-25|-50|-75)?\.safetensors")
WORDS, WORDS_OF_README = 1000, 600
LONGER = {
    "docs/laboratory.md": "a log, to search and not to read through",
    "CHANGELOG.md": "a list that grows with each version",
}
"""Documents that may be longer than a page, and why."""


class Parsed(Exception):
    """What a command was asked for, instead of doing it."""


_parse_args = argparse.ArgumentParser.parse_args


def stop(parser, arguments=None):
    raise Parsed(_parse_args(parser, arguments))


def options_of(words):
    """The options of a command that a document gives, which goes no further; {} for a program that is not ours."""
    match [PLACEHOLDERS.get(word, word) for word in words]:
        case ["make", target]:
            assert re.search(rf"^{target}:", (REPOSITORY / "Makefile").read_text(), re.MULTILINE)
            return {}
        case ["python3", "-m", "pip", "install", *where, "rosbags"]:
            assert all((REPOSITORY / folder / "setup.py").exists() for folder in where)
            return {}
        case ["pip", "install", what] | ["pip", "install", "-e", what]:
            project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]
            extra = re.fullmatch(r"\.\[(.*)\]", what)
            assert extra is None or set(extra[1].split(",")) <= set(project["optional-dependencies"])
            return {}
        case ["source", "activate"] | ["gcc" | "python3" | "ros2", *_]:
            return {}  # the tests of exported files and of the ROS nodes run these, but for other packages' programs
        case ["uvx", "--from", ".", "apollonius", *arguments] | ["apollonius", *arguments]:
            program = main
        case ["python", "-m", module, *arguments]:
            program = importlib.import_module(module).main
        case ["python", script, *arguments]:
            program = runpy.run_path(str(REPOSITORY / script))["main"]
        case _:
            pytest.fail("a command of an unknown kind: say here how it is checked")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(argparse.ArgumentParser, "parse_args", stop)
        patch.setattr(values, "_path_fact", lambda question: True)  # the files that a document names are not here
        patch.setattr(values, "_unwritable", lambda path, folder: None)
        patch.setattr("sys.argv", [words[0], *arguments])
        with pytest.raises(Parsed) as parsed:
            program(*([arguments] if program is main else []))
    return vars(parsed.value.args[0])


def files_made(document):
    """The files and runs' folders that a document's commands, Python and named blocks of TOML make."""
    code = [block.code for block in blocks(document)]
    named = re.findall(r"""(?:--out |^# |Path\(")([\w./-]+)""", "\n".join(code), re.MULTILINE)
    return {*READERS_FILES, *named}


def check_command(words, document):
    """A command that a document gives can be given; the players and games in it exist or are made in the document."""
    options, made = options_of(words), files_made(document)
    for player in (options.get(name) for name in ("pursuer", "evader", "pursuers", "evaders", "agent", "against")):
        for name in [player] if isinstance(player, str) else player or []:
            bare = bare_name(name)
            trained = TRAINED.fullmatch(bare)
            assert bare in {*PLAYERS, *zoo_names()} or (trained["run"] if trained else bare) in made, name
    game = options.get("game")
    if game and game.endswith(GAME_FILES):
        assert game in made or (REPOSITORY / split_team(game)[1]).exists(), game
    elif game:
        assert is_scenario(game) or find_game(game)


ON_A_ROBOT = ("concepts/simulation", "how-to/ros2", "how-to/export", "how-to/lidar", "reference/agents")
"""Documents that say what the one on the shield says of robots."""


def test_documents_give_the_same_advice_on_shields():
    """And the one on the shield has the numbers of the benchmark."""
    text = (DOCS / "concepts/shield.md").read_text()
    (advice,) = re.findall(r"^\*\*On a robot: .*?\*\*", text, re.MULTILINE)
    assert [name for name in ON_A_ROBOT if advice not in (DOCS / f"{name}.md").read_text()] == []
    counts = {}
    for cell in json.loads((DOCS / "results" / "combinations.json").read_text())["cells"]:
        for side, name in zip(("pursuers", "evaders"), cell["players"], strict=True):
            kind = "shielded" if name.startswith(SHIELDED) else "bare"
            before = counts.get((side, kind), (0, 0))
            counts[side, kind] = [one + more for one, more in zip(before, cell[f"{side} fail"], strict=True)]
    assert len(counts) == 4
    del counts["evaders", "bare"]  # which the page leaves out
    for fails, games in counts.values():
        assert re.search(rf"\b{fails} (of|\|) {games:,}\b", text), (fails, games)


def test_start_page_cites_what_the_citation_file_does():
    cited = yaml.safe_load((REPOSITORY / "CITATION.cff").read_text())
    (paper,) = cited["references"]
    (text,) = (block.code for block in blocks(DOCS / "start.md") if block.code.startswith("@software"))
    authors = " and ".join(f"{one['family-names']}, {one['given-names']}" for one in paper["authors"])
    pages = f"{paper['start']}--{paper['end']}"
    ours = cited["title"], cited["authors"][0]["name"], cited["version"], cited["abstract"].removesuffix(".")
    theirs = paper["title"], authors, paper["collection-title"].split(" (")[0], pages, str(paper["year"])
    assert [one for one in (*ours, *theirs) if f"{{{one}" not in text] == []


def test_every_code_block_names_a_known_language():
    assert {block.language for block in ALL} <= set(LANGUAGES)


@pytest.mark.parametrize("document", DOCUMENTS, ids=name_of)
def test_every_command_of_a_document_is_accepted(document):
    for words in asides(document):
        check_command(words, document)
    for block in blocks(document):
        for words in block.commands():
            check_command(words, document)


@pytest.mark.parametrize("block", [block for block in ALL if block.language == "toml"], ids=str)
def test_every_toml_block_is_a_game_or_config(block, tmp_path):
    path = tmp_path / "game.toml"
    path.write_text(re.sub(r"(suite-v\d)/(train|held-out)", r"\1/maze-00,maze-01", block.code))  # all take their time
    if "[[stages]]" in block.code or "[game." in block.code:
        assert load_config(path) != RunConfig()
        return
    write(tmp_path, room())  # the map that some of them name
    says_nothing = tmp_path / "usual.toml"
    says_nothing.write_text("")
    assert to_dict(find_game(str(path))) != to_dict(find_game(str(says_nothing)))


@pytest.mark.parametrize("document", [one for one in DOCUMENTS if name_of(one) not in LONGER], ids=name_of)
def test_page_stays_within_its_word_limit(document):
    """Words as `wc -w` counts them, code and tables included."""
    most = WORDS_OF_README if document == REPOSITORY / "README.md" else WORDS
    words = len(document.read_text().split())
    assert words <= most


def test_glossary_names_exist_in_the_code():
    homes = {}
    for path in (REPOSITORY / "apollonius").rglob("*.py"):
        module = ".".join(path.relative_to(REPOSITORY).with_suffix("").parts)
        homes |= dict.fromkeys(re.findall(r"^(?:class|def) (\w+)", path.read_text(), re.MULTILINE), module)
    rows = re.findall(r"^\|.*\| (`.*`) \|$", (DOCS / "reference" / "glossary.md").read_text(), re.MULTILINE)
    names = [name for row in rows for name in re.findall("`([^`]+)`", row)]
    assert len(names) > 30
    for name in names:
        first, *parts = name.split(".")
        assert first in homes, name
        thing = getattr(importlib.import_module(homes[first]), first)
        assert all(hasattr(thing, part) or part in thing.__dataclass_fields__ for part in parts), name


def anchors(document):
    """What can stand after the # of a link to a document, as GitHub makes it from the headings."""
    headings = re.findall(r"^#+ (.*)$", document.read_text(), re.MULTILINE)
    bare = [re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading).strip().lower() for heading in headings]
    return {re.sub(r"[^\w\- ]", "", heading).replace(" ", "-") for heading in bare}


@pytest.mark.parametrize("document", DOCUMENTS, ids=name_of)
def test_every_local_link_has_a_target(document):
    for link in re.findall(r"\]\(([^)\s]+)\)", document.read_text()):
        if not link.startswith("http"):
            file, _, anchor = link.partition("#")
            target = document.parent / file if file else document
            target = DOCS / file if document in PAGES and not target.exists() else target
            assert target.exists(), link
            assert not anchor or anchor in anchors(target), link


FEWER = {
    r"^([\w.]+=[\d.]+:[\d.]+):\d+$": r"\1:2",
    r"^0-9$": "0-1",
    r"^(dqn\.\w+=[^,]+),.*$": r"\1",
    "E_response": "E_curriculum",
}
"""Values of a sweep, and the fewer that a walk takes; the agents of the training that it makes."""
GRIDS = {"game": "5x5x3x8", "safety": "21x21x5x16", "reach": "21x21x9x16"}
ELSEWHERE = {"make", "pip", "source", "gcc", "python3", "python", "reproduce", "exploit", "simulate", "replay"}
"""Commands that a walk leaves out: the tests of their rooms run them, and a test changes no installation."""


def with_less(words, options):
    """A command that takes seconds instead of minutes or hours; None for one that is run elsewhere."""
    program, *rest = words[3:] if words[0] == "uvx" else words
    what = rest[0] if program == "apollonius" else program
    if what in ELSEWHERE or (what == "play" and not options["site"]) or "runs/speeds" in words:
        return None
    if "sac" in words or ("onnx" in words and not find_spec("jax2onnx")):
        return None  # the usual networks of SAC are large: tests/learn trains it
    # Where games are recorded, those that are named later must be among them.
    changes = {"--games": "8"} if "games" in options and what != "show" and not options.get("record") else {}
    if what == "train":
        changes = {"--config": "tiny.toml"}
        rest = [word for word in rest if word not in ("--preset", options["preset"])]
    if what == "regret":
        changes = {"--games": "8"} | ({} if options["tables"] else {"--grid": GRIDS["game"]})
    if what == "solve":
        changes["--grid"] = GRIDS[options["what"]]
    for many, few in FEWER.items():
        rest = [re.sub(many, few, word) for word in rest]
    if what == "tournament":
        changes |= {} if options["pursuers"] else {"--pursuers": "intercept", "--evaders": "flee-aware"}
    if options.get("game") == "suite-v1/held-out":
        changes["--game"] = "suite-v1/racks-07,racks-08"
    for option, value in changes.items():
        if option in rest:
            rest[rest.index(option) + 1] = value
        else:
            rest += [option, value]
    return rest


WALKED = (
    "README.md",
    "website/pages/index.md",
    "docs/start.md",
    "docs/how-to/runs.md",
    "docs/how-to/evaluate.md",
    "docs/how-to/export.md",
    "docs/how-to/solve.md",
    "docs/how-to/pictures.md",
    "docs/tutorials/play.md",
    "docs/tutorials/train.md",
    "docs/tutorials/floor_plan.md",
    "docs/tutorials/own_learner.md",
)
"""Documents that a test follows from their first block to their last."""
LESS = {"512, 32, 600": "64, 32, 40", "learn(200_000)": "learn(6_000)", "10_500": "10_050"}
"""Numbers in Python, and those with which it takes seconds."""


@pytest.mark.slow
@pytest.mark.parametrize("name", WALKED)
def test_code_and_commands_of_a_document_run_to_its_end(name, tmp_path, monkeypatch):
    """All its commands with less training, fewer games and coarser grids, its Python as it stands, in one folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)  # what is exported to it is imported
    monkeypatch.setattr("apollonius.evaluate.pairings.JUDGED_GAMES", 8)  # of each training
    Path("tiny.toml").write_text(tomli_w.dumps(to_dict(RUN)), encoding="utf-8")
    names = {}
    for block in blocks(REPOSITORY / name):
        # What takes longer to run than to compile well.
        solves = re.search(r"solve_|solve game|regret|learn", block.code)
        jax.config.update("jax_disable_most_optimizations", not solves)
        with jax.numpy_dtype_promotion("standard"):  # which optax needs
            if named := re.match(r"# (\S+\.toml)\n", block.code):
                Path(named[1]).write_text(f"max_steps = 30\n{block.code}", encoding="utf-8")
            if block.language == "python" and ("stable_baselines3" not in block.code or find_spec("stable_baselines3")):
                code = block.code
                for much, less in LESS.items():
                    code = code.replace(much, less)
                exec(code, names)
            for words in block.commands():
                options = options_of(words)
                arguments = with_less(words, options)
                assert arguments is None or main(arguments) == 0, arguments
                for option in ("out", "plot", "site") if arguments else ():
                    assert not options.get(option) or Path(options[option]).exists(), arguments
    jax.config.update("jax_disable_most_optimizations", True)


HOLDS = {
    "jax": "seen.shape == (17,) and timesteps.outcome.shape == (200, 4096) and distances[0] < distances[1]",
    "environments": "seen.shape == (256, 3, 166) and own_rewards.shape == status.shape == (256, 3)"
    " and env.observation_space.shape == (4,)",
    "teams": "len(env.possible_agents) == 5 and all('status' in infos[agent] for agent in actions)",
}
"""What is true after the Python of a guide."""


@pytest.mark.slow
@pytest.mark.parametrize("name", HOLDS)
def test_python_in_a_guide_runs(name):
    pytest.importorskip("pettingzoo", reason="needs pettingzoo: pip install pettingzoo")
    names = {}
    for block in blocks(DOCS / "how-to" / f"{name}.md"):
        if block.language == "python" and ("pyspiel" not in block.code or find_spec("pyspiel")):
            exec(block.code, names)
    assert eval(HOLDS[name], names)


PAPER = (DOCS / "concepts" / "paper.md").read_text(encoding="utf-8")
PLACE = re.compile(r"((?:`[\w.]+`(?:, | and )?)+) in `([\w/]+\.py)`")


def defined_names(path):
    """The functions and classes of a module, and the methods of these."""
    names = set()
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef):
            names.add(node.name)
        if isinstance(node, ast.ClassDef):
            names |= {f"{node.name}.{inner.name}" for inner in node.body if isinstance(inner, ast.FunctionDef)}
    return names


def test_equations_and_lines_of_the_paper_are_where_the_table_says():
    """Each row names functions that exist, and the file of an equation or algorithm mentions it."""
    rows = [line.strip("| ").split(" | ") for line in PAPER.splitlines() if line.startswith("| ") and ".py`" in line]
    assert len(rows) >= 12
    for label, package, _ in rows:
        places = PLACE.findall(package)
        assert places, package
        texts = []
        for names, file in places:
            path = REPOSITORY / "apollonius" / file
            texts.append(path.read_text(encoding="utf-8"))
            assert set(re.findall(r"`([\w.]+)`", names)) <= defined_names(path), (names, file)
        kind = re.match(r"(Eq\.|Fig\.|Algorithm) ?(\d)", label)
        if kind:
            assert any(f"{kind[1]} {kind[2]}" in text for text in texts), (label, package)


@pytest.mark.parametrize(("number", "file", "last"), [(1, "fixed_target", 11), (2, "self_play", 12)])
def test_every_line_of_an_algorithm_is_a_comment_in_its_file(number, file, last):
    text = (REPOSITORY / "apollonius" / "learn" / f"{file}.py").read_text(encoding="utf-8")
    lines = set()
    for comment in re.findall(r"# (Algorithm .*)", text):
        for first, _, end in re.findall(r"[Ll]ines? (\d+)( to (\d+))?", comment):
            lines |= set(range(int(first), int(end or first) + 1))
    assert lines == set(range(1, last + 1))
