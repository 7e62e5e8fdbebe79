"""The arenas that ship with the package: each is sound, can be played in, and is found by its name."""

import pytest

from apollonius.arenas.file import GALLERY, about_game, find_game, game_names
from apollonius.arenas.survey import survey
from apollonius.game.presets import PRESETS

FILES = [name for name in game_names() if name not in PRESETS]


def test_there_are_an_office_a_warehouse_and_a_maze_beside_the_presets():
    assert game_names()[: len(PRESETS)] == list(PRESETS)
    assert {"office", "warehouse", "maze"} <= set(FILES) == {path.stem for path in GALLERY.iterdir()}
    assert all(20 < len(about_game(name)) < 110 for name in game_names())


@pytest.mark.parametrize("name", [*PRESETS, *FILES])
def test_each_is_sound_and_its_starts_have_room(name):
    game = find_game(name)
    found = survey(game)
    assert found.wrong == ()
    assert found.notes == ()
    assert [parts.max() for parts in found.parts] == [1, 1]
    assert not found.haven.any()
    if name in FILES:
        assert 0.02 < found.blocked.mean() < 0.5
        assert game.arena.polygons
