"""How hard README and docs are to read: fails where a page is harder than its limit or has too long a sentence.

    python .ci/readability.py [--all]

The grade is the automated readability index, as textstat computes it: years of school after which a text is
understood at first reading. Code, tables, headings and links do not count; items of lists are sentences.
"""

import argparse
import re
import sys
from pathlib import Path

import textstat

ROOT = Path(__file__).parents[1]
READ_FIRST = {"README.md", *(f"docs/{name}.md" for name in ("measured", "command-line", "convert", "add-a-station"))}
"""Pages that people read before they know the project, beside the tutorials."""
MOST = {True: 9.0, False: 12.0}
"""Hardest grade of a page that is read first, and of all others: plain English for the public has about 9."""
FEW_WORDS = 60
"""A page with fewer says nothing about its style."""
MOST_WORDS = 40
"""Longest sentence: one idea seldom takes more than half of it."""


def prose(markdown: str) -> str:
    """Sentences of a page, without what is not read as a sentence."""
    text = re.sub(r"^(```|~~~).*?^\1$", "", markdown, flags=re.MULTILINE | re.DOTALL)
    text = re.sub(r"^\$\$.*?\$\$$", "", text, flags=re.MULTILINE | re.DOTALL)
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)
    text = re.sub(r"`[^`]*`|\$[^$]*\$|<[^>]*>", "it", text)
    lines = [line for line in text.splitlines() if not re.match(r"\s*(\||#|!|>)", line)]
    text = re.sub(r"\n\s*(?:[-*]|\d+\.) +", ".\n\n", "\n".join(lines))
    return re.sub(r"\n{2,}", ".\n", text.replace("**", "")).replace(":.", ".").replace("..", ".")


def long_sentences(text: str) -> list[str]:
    """Sentences with more than `MOST_WORDS` words, in one line each."""
    sentences = (" ".join(sentence.split()) for sentence in re.split(r"(?<=[.!?])\s+", text))
    return [sentence for sentence in sentences if len(sentence.split()) > MOST_WORDS]


def pages() -> list[Path]:
    """README, how-tos, tutorials and explanations; not the decisions, which are for those who change the code."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def findings(page: Path, *, shows_all: bool) -> tuple[bool, list[str]]:
    """Whether a page is too hard, and what there is to say of it."""
    name, text = str(page.relative_to(ROOT)), prose(page.read_text(encoding="utf-8"))
    if textstat.lexicon_count(text) < FEW_WORDS:
        return False, []
    most = MOST[name in READ_FIRST or "tutorial-" in name]
    grade = textstat.automated_readability_index(text)
    told = [f"{name}: grade {grade:.1f}, at most {most:g}"] if shows_all or grade > most else []
    long = [
        f"{name}: {len(sentence.split())} words in a sentence, at most {MOST_WORDS}: {sentence[:70]} ..."
        for sentence in long_sentences(text)
    ]
    return grade > most or bool(long), told + long


def main() -> int:
    """Exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--all", action="store_true", help="print all pages, not only those that are too hard")
    shows_all = parser.parse_args().all
    found = [findings(page, shows_all=shows_all) for page in pages()]
    print("\n".join(line for _, told in found for line in told) or "readability: every page keeps its limits")  # noqa: T201
    return int(any(is_hard for is_hard, _ in found))


if __name__ == "__main__":
    sys.exit(main())
