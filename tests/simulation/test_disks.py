"""What disks do to files: to a part of one, and to nothing else."""

import random

import pytest
from disks import PAGE, SECTOR, backup_of, clear, lose_write

CONTENT = bytes(range(1, 251)) * 100


@pytest.fixture
def folder(tmp_path):
    folder = tmp_path / "kept"
    folder.mkdir()
    for name in ("one", "two"):
        (folder / name).write_bytes(CONTENT)
    return folder


def changed_places(folder) -> dict[str, list[int]]:
    """Places of each file whose content is another one, of files that have any."""
    files = {path.name: path.read_bytes() for path in folder.iterdir()}
    places = {name: [n for n in range(len(CONTENT)) if content[n] != CONTENT[n]] for name, content in files.items()}
    return {name: of for name, of in places.items() if of}


@pytest.mark.parametrize("seed", range(10))
def test_a_block_that_is_gone_is_zeros_and_the_rest_stays(folder, seed):
    path = clear(folder, random.Random(seed))
    ((name, places),) = changed_places(folder).items()
    content = path.read_bytes()
    assert (path.name, len(content)) == (name, len(CONTENT))
    assert len(places) <= PAGE
    assert places[0] % SECTOR == 0
    assert not any(content[place] for place in places)


@pytest.mark.parametrize("seed", range(10))
def test_a_write_that_was_never_made_leaves_what_was_there_before(folder, seed):
    copy = backup_of(folder)
    changed = CONTENT.replace(b"\x07", b"\x08")
    (folder / "two").write_bytes(changed)
    path = lose_write(copy, folder, random.Random(seed))
    assert path == folder / "two"
    content = path.read_bytes()
    lost = [place for place in range(len(CONTENT)) if content[place] != changed[place]]
    assert lost
    assert lost[-1] - lost[0] < PAGE
    assert all(content[place] == CONTENT[place] for place in lost)


def test_where_nothing_was_written_no_write_is_lost(folder):
    assert lose_write(backup_of(folder), folder, random.Random(1)) is None
    assert changed_places(folder) == {}
