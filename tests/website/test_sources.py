"""The documents as the site has them: each belongs to a part, and its links lead to pages."""

import json

import pytest

from tests.documents import REPOSITORY, blocks
from website.sources import GENERATED, PARTS, at_home, documents, notebook

HOME = REPOSITORY / "README.md"
DOCUMENT = REPOSITORY / "docs" / "how-to" / "jax.md"


def test_each_document_belongs_to_one_part():
    pages = [page for part in PARTS.values() for page in part]
    assert len(pages) == len(set(pages))
    assert set(documents()) == {f"{page}.md" for page in set(pages) - GENERATED} | {"index.md"}


@pytest.mark.parametrize(
    ("document", "link", "there"),
    [
        (DOCUMENT, "[rules](../reference/rules.md#starts)", "[rules](../reference/rules.md#starts)"),
        (DOCUMENT, "[numbers](../results/paper.json)", "[numbers](../results/paper.json)"),
        (DOCUMENT, "[elsewhere](https://arxiv.org/)", "[elsewhere](https://arxiv.org/)"),
        (DOCUMENT, "![a picture](../figures/chase.gif)", "![a picture](../figures/chase.gif)"),
        (DOCUMENT, "[games](../../tests/golden)", "games"),
        (DOCUMENT, "[[`games`](../../tests/golden)]", "[`games`]"),
        (DOCUMENT, "[home](../../README.md#use)", "[home](../index.md)"),
        (DOCUMENT, "[licence](../../LICENSE)", "[licence](../licence.md)"),
        (HOME, "[start](docs/start.md)", "[start](start.md)"),
        (HOME, "[cite](CITATION.cff)", "cite"),
    ],
)
def test_links_are_those_of_the_site(document, link, there):
    assert at_home(f"See {link}, too.", document) == f"See {there}, too."


@pytest.mark.parametrize("name", ["play", "train", "floor_plan", "own_learner"])
def test_what_a_tutorial_runs_is_a_cell_of_its_notebook(name):
    path = REPOSITORY / "docs" / "tutorials" / f"{name}.md"
    cells = json.loads(notebook(path.read_text()))["cells"]
    run = [cell["source"] for cell in cells if cell["cell_type"] == "code"]
    shown = [block for block in blocks(path) if "apollonius play" not in block.code]
    assert [code.partition("\n")[2] if code.startswith("%%") else code for code in run] == [
        block.code.rstrip("\n") for block in shown
    ]
    text = "".join(cell["source"] for cell in cells if cell["cell_type"] == "markdown")
    assert "](" not in text.replace("](https:", "")
