"""The documents as the site has them: each belongs to a part, and its links lead to pages."""

import json
import re

import pytest

from tests.documents import REPOSITORY, blocks
from website.sources import INSTALL, PARTS, at_home, documents, notebook, write_sources

HOME = REPOSITORY / "README.md"
DOCUMENT = REPOSITORY / "docs" / "how-to" / "jax.md"


def test_each_document_belongs_to_one_part():
    pages = [page for part in PARTS.values() for page in part]
    assert len(pages) == len(set(pages))
    generated = {"reference/command", "reference/config", "reference/api/index"}
    assert set(documents()) == {f"{page}.md" for page in set(pages) - generated} | {"index.md"}


@pytest.mark.parametrize(
    ("document", "link", "there"),
    [
        (DOCUMENT, "[rules](../reference/rules.md#starts)", "[rules](../reference/rules.md#starts)"),
        (DOCUMENT, "[numbers](../results/paper.json)", "[numbers](../results/paper.json)"),
        (DOCUMENT, "[elsewhere](https://arxiv.org/)", "[elsewhere](https://arxiv.org/)"),
        (DOCUMENT, "![a picture](../figures/course.png)", "![a picture](../figures/course.png)"),
        (DOCUMENT, "[games](../../tests/golden)", "games"),
        (DOCUMENT, "[[`games`](../../tests/golden)]", "[`games`]"),
        (DOCUMENT, "[home](../../README.md#use)", "[home](../index.md)"),
        (DOCUMENT, "[licence](../../LICENSE)", "[licence](../licence.md)"),
        (DOCUMENT, "[C](../../jaxpr2c/README.md#layout)", "[C](../jaxpr2c.md#layout)"),
        (REPOSITORY / "jaxpr2c" / "README.md", "[export](../docs/how-to/export.md)", "[export](how-to/export.md)"),
        (HOME, "[start](docs/start.md)", "[start](start.md)"),
        (HOME, "[cite](CITATION.cff)", "cite"),
    ],
)
def test_links_are_rewritten_for_the_site(document, link, there):
    assert at_home(f"See {link}, too.", document) == f"See {there}, too."


@pytest.mark.parametrize("name", ["play", "train", "floor_plan", "own_learner"])
def test_notebook_has_a_cell_for_each_block_of_its_tutorial(name):
    path = REPOSITORY / "docs" / "tutorials" / f"{name}.md"
    book = json.loads(notebook(path.read_text()))
    assert (book["nbformat"], book["nbformat_minor"]) == (4, 4), "of which cells have no ids"
    assert book["metadata"]["kernelspec"]["name"] == "python3"
    run = [cell for cell in book["cells"] if cell["cell_type"] == "code"]
    assert all((cell["outputs"], cell["execution_count"], cell["metadata"]) == ([], None, {}) for cell in run)
    expected = []
    for block in blocks(path):
        if block.language == "text":
            continue
        first = {"python": "", "sh": "%%sh -e\n", "toml": f"%%writefile {block.code.split()[1]}\n"}[block.language]
        expected += [first + block.code.rstrip("\n")] * ("apollonius play" not in block.code)
    assert [cell["source"] for cell in run] == [INSTALL, *expected]
    text = "\n\n".join(cell["source"] for cell in book["cells"] if cell["cell_type"] == "markdown")
    assert text.startswith("# ")
    assert "](" not in text.replace("](https:", "")
    left = path.read_text()
    for code in re.findall(r"^```(?:python|sh|toml)\n.*?^```\n", left, re.MULTILINE | re.DOTALL):
        left = left.replace(code, "") if "apollonius play" not in code else left
    assert re.findall(r"\w+", text) == re.findall(r"\w+", re.sub(r"\]\((?!https:)[^)]*\)", "]", left))


def test_toml_block_without_a_name_becomes_text():
    page = "# Page\n\n```toml\nmax_steps = 3\n```\n\nSee [here](a.md), [there](https://b.org).\n"
    cells = json.loads(notebook(page))["cells"]
    assert [cell["cell_type"] for cell in cells] == ["code"] + ["markdown"] * 3
    assert "".join(cell["source"] for cell in cells).endswith("See here, [there](https://b.org).")


def test_home_page_links_the_leaderboard_below_agents(tmp_path):
    write_sources(tmp_path)
    home = (tmp_path / "index.md").read_text()
    assert "](benchmarks/leaderboard.md" in home.partition("## Agents")[2]


def test_tutorial_links_its_notebook_below_its_title(tmp_path):
    write_sources(tmp_path / "sources")
    tutorials = tmp_path / "sources" / "tutorials"
    books = {path.stem for path in tutorials.glob("*.ipynb")}
    assert books == {path.stem for path in tutorials.glob("*.md")} - {"index"}
    for name in books:
        title, _, offer, *_ = (tutorials / f"{name}.md").read_text().splitlines()
        assert title.startswith("# ")
        assert f"({name}.ipynb)" in offer


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_first_tutorial_runs_as_a_notebook(tmp_path):
    """It plays, trains for some minutes and evaluates. Jupyter's own client runs it."""
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    text = (REPOSITORY / "docs" / "tutorials" / "play.md").read_text()
    book = nbformat.reads(notebook(text), as_version=4)
    nbclient.NotebookClient(book, timeout=1200, resources={"metadata": {"path": str(tmp_path)}}).execute()
    printed = ["".join(output.get("text", "") for output in cell.get("outputs", [])) for cell in book.cells]
    assert (tmp_path / "chase.gif").stat().st_size > 10_000
    assert (tmp_path / "runs" / "first" / "agents" / "P_curriculum-25.safetensors").is_file()
    evaluated = [text for text in printed if "flee-aware (evader) wins" in text]
    assert evaluated, "the last cell has been run"
