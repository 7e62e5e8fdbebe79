"""What the check of a built folder finds, and what it lets pass."""

import pytest

from website.__main__ import complaints

PAGE = '<html><body><h1 id="top">A</h1>{}</body></html>'


def check(folder, *elements):
    (folder / "below").mkdir()
    (folder / "below" / "b.html").write_text(PAGE.format('<a href="../a.html#top">up</a>'))
    (folder / "picture.png").write_bytes(b"")
    (folder / "a.html").write_text(PAGE.format("".join(elements)))
    return complaints(folder)


@pytest.mark.parametrize(
    "element",
    [
        '<a href="below/b.html#top">there</a>',
        '<a href="below/b.html?game=office">there</a>',
        '<a href="#top">here</a>',
        '<a href="https://arxiv.org/">elsewhere, if the reader asks for it</a>',
        '<img src="picture.png">',
        '<img src="data:image/png;base64,AAAA">',
    ],
)
def test_what_is_there_passes(tmp_path, element):
    assert check(tmp_path, element) == []


@pytest.mark.parametrize(
    ("element", "wrong"),
    [
        ('<a href="nowhere.html">x</a>', "leads nowhere"),
        ('<a href="below">a folder, which only a host opens</a>', "leads nowhere"),
        ('<a href="../outside.html">x</a>', "leads nowhere"),
        ('<a href="below/b.html#bottom">x</a>', "no such place"),
        ('<a href="#bottom">x</a>', "no such place"),
        ('<a href="/a.html">x</a>', "root of a host"),
        ('<script src="https://cdn.example/x.js"></script>', "from elsewhere"),
        ('<img src="//cdn.example/x.png">', "from elsewhere"),
        ('<link rel="stylesheet" href="https://fonts.example/x.css">', "from elsewhere"),
    ],
)
def test_what_is_not_there_is_told(tmp_path, element, wrong):
    (found,) = check(tmp_path, element)
    assert found.startswith("a.html: ")
    assert wrong in found
