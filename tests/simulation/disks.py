"""What disks do to files: bits that flip, blocks that are gone, writes astray or never made, copies brought back."""

import random
import shutil
import tempfile
from pathlib import Path

PAGE = 4096
"""What a disk writes at once, and a page of SQLite. [byte]"""
SECTOR = 512
"""The least that a disk writes. [byte]"""
FLIPPED = (1, 1, 4, 32)
"""Bits that flip at once."""
_NOT_DATA = ("-shm", ".at", ".part", ".lock")


def files_of(folder: Path) -> list[Path]:
    """Files that hold something, without those that a daemon has put aside."""
    files = [file for file in sorted(folder.rglob("*")) if file.is_file() and file.stat().st_size]
    return [file for file in files if not file.name.endswith(_NOT_DATA) and "refused" not in file.name]


def flip_bits(folder: Path, dice: random.Random) -> Path | None:
    """Flip bits of one file, anywhere or in its first or last page; None if there is no file.

    Half of the time each file is as likely as another one, else each byte.
    """
    files = files_of(folder)
    if not files:
        return None
    sizes = [file.stat().st_size for file in files]
    path = dice.choice(files) if dice.random() < 0.5 else dice.choices(files, sizes)[0]
    size = path.stat().st_size
    begin, end = _part_of(size, dice)
    with path.open("r+b") as file:
        for _ in range(dice.choice(FLIPPED)):
            place = dice.randrange(begin, end)
            file.seek(place)
            (byte,) = file.read(1)
            file.seek(place)
            file.write(bytes([byte ^ (1 << dice.randrange(8))]))
    return path


def misdirect(folder: Path, dice: random.Random) -> Path | None:
    """Write what belongs elsewhere: a page of a file over another one, or a file in the place of its neighbour."""
    files = files_of(folder)
    paged = [file for file in files if file.stat().st_size >= 2 * PAGE]
    whole = [file for file in files if len(list(file.parent.glob(f"*{file.suffix}"))) > 1 and file.suffix == ".json"]
    whole += [file for file in files if file.suffix == ".parquet"]
    if whole and (not paged or dice.random() < 0.5):
        path = dice.choice(whole)
        others = [file for file in whole if file.suffix == path.suffix and file != path]
        if others:
            shutil.copyfile(dice.choice(others), path)
            return path
    if not paged:
        return None
    path = dice.choice(paged)
    pages = path.stat().st_size // PAGE
    source, target = dice.sample(range(pages), 2)
    with path.open("r+b") as file:
        file.seek(source * PAGE)
        page = file.read(PAGE)
        file.seek(target * PAGE)
        file.write(page)
    return path


def clear(folder: Path, dice: random.Random) -> Path | None:
    """Let a block of a file be gone: nothing but zeros is read there. None if there is no file."""
    files = files_of(folder)
    if not files:
        return None
    path, block = dice.choice(files), dice.choice((SECTOR, PAGE))
    size = path.stat().st_size
    place = dice.randrange(*_part_of(size, dice)) // block * block
    _overwrite(path, place, bytes(min(block, size - place)))
    return path


def lose_write(copy: Path, folder: Path, dice: random.Random) -> Path | None:
    """Let a block of a file be as it was in a copy: what was written there never was. None if nothing was."""
    files = [file for file in files_of(folder) if (copy / file.relative_to(folder)).is_file()]
    size = dice.choice((SECTOR, PAGE))
    changed = [(file, blocks) for file in files if (blocks := _changed(copy / file.relative_to(folder), file, size))]
    if not changed:
        return None
    path, blocks = dice.choice(changed)
    _overwrite(path, *dice.choice((blocks[0], dice.choice(blocks), blocks[-1])))
    return path


def _part_of(size: int, dice: random.Random) -> tuple[int, int]:
    """All of a file, or the page at an end of it, where what tells of the rest stands."""
    return dice.choice(((0, size), (0, min(PAGE, size)), (max(0, size - PAGE), size)))


def _changed(before: Path, after: Path, size: int) -> list[tuple[int, bytes]]:
    """Place of each block that has another content now, and what was there before, as far as both have it."""
    old, new = before.read_bytes(), after.read_bytes()
    places = range(0, min(len(old), len(new)), size)
    blocks = ((place, old[place : min(place + size, len(new))]) for place in places)
    return [(place, block) for place, block in blocks if new[place : place + len(block)] != block]


def _overwrite(path: Path, place: int, content: bytes) -> None:
    with path.open("r+b") as file:
        file.seek(place)
        file.write(content)


def backup_of(folder: Path) -> Path:
    """A copy of a folder, as it is in this moment."""
    copy = Path(tempfile.mkdtemp(prefix="backup-", dir=_place_of_copies(folder)))
    if folder.is_dir():
        shutil.copytree(folder, copy, dirs_exist_ok=True, ignore=shutil.ignore_patterns("*-shm"))
    return copy


def bring_back(copy: Path, folder: Path) -> bool:
    """A copy in the place of a folder: it is another one now."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(copy, folder)
    return True


class LyingDisk:
    """A disk that says from now on that it has written, and forgets some of it when the power fails."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._copy = backup_of(folder)

    def lose(self, dice: random.Random) -> bool:
        """Forget: of a file nothing, its last bytes, or all since the beginning of the lie. Whether anything changed.

        What belongs together is treated alike, but at times a database and its log are not.
        """
        lost = False
        for file in files_of(self._folder):
            before = self._copy / file.relative_to(self._folder)
            is_same = before.exists() and before.read_bytes() == file.read_bytes()
            match "none" if is_same else dice.choice(("none", "torn", "old")):
                case "torn":
                    least = before.stat().st_size if before.exists() else 0
                    size = file.stat().st_size
                    with file.open("r+b") as opened:
                        opened.truncate(dice.randint(min(least, size - 1), size - 1))
                case "old" if before.exists():
                    shutil.copyfile(before, file)
                case "old":
                    file.unlink()
                case _:
                    continue
            lost = True
        return lost


def _place_of_copies(folder: Path) -> Path:
    place = folder.parent / "copies"
    place.mkdir(parents=True, exist_ok=True)
    return place
