"""What MkDocs calls while it builds the site: pages from outside `docs/`, and the reference made from code."""

import re
import sys
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

sys.path.insert(0, str(Path(__file__).parent))
import notebooks
import schemas

import reference

ROOT = Path(__file__).parents[2]
MERMAID = ROOT / "build" / "mermaid" / "package" / "dist" / "mermaid.min.js"
"""What draws the diagrams, if `make docs` could get it; without it they are shown as text, and nothing is fetched."""

OUTSIDE = {
    "index.md": "README.md",
    "contributing.md": "CONTRIBUTING.md",
    "changelog.md": "CHANGELOG.md",
    "benchmarks.md": "benchmarks/README.md",
}
"""Pages of the site that lie elsewhere in the repository."""


def on_config(config: Any) -> Any:
    """Draw diagrams with a script of our own."""
    if MERMAID.is_file():
        config.extra_javascript.append("assets/mermaid.min.js")
    return config


def on_files(files: Files, config: Any) -> Files:
    """Add the pages from outside and the reference."""
    for page, source in OUTSIDE.items():
        text = (ROOT / source).read_text(encoding="utf-8")
        files.append(File.generated(config, page, content=_inside(text, (ROOT / source).parent)))
    for page, content in reference.pages().items():
        files.append(File.generated(config, f"reference/{page}", content=content))
    for page, made in schemas.schema_pages().items():
        files.append(File.generated(config, f"reference/{page}", content=made))
    for page, content in notebooks.notebook_pages().items():
        files.append(
            File.generated(
                config, f"notebooks/{page}", content=_inside(content, ROOT / "docs" / "notebooks", depth=1)
            )
        )
    if MERMAID.is_file():
        files.append(File.generated(config, "assets/mermaid.min.js", content=MERMAID.read_bytes()))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Let links of `docs/` to pages from outside lead to their place on the site."""
    if page.file.src_uri in OUTSIDE or page.file.generated_by:
        return markdown
    return _inside(markdown, (ROOT / "docs" / page.file.src_uri).parent, depth=page.file.src_uri.count("/"))


def _inside(text: str, folder: Path, depth: int = 0) -> str:
    """Text whose links to files of the repository lead to pages of the site; others name the file only."""
    places = {source: page for page, source in OUTSIDE.items()}

    def link(match: re.Match[str]) -> str:
        words, target, anchor = match[1], match[2], match[3] or ""
        path = (folder / target).resolve()
        if re.match(r"[a-z]+:", target) or not path.is_relative_to(ROOT):
            return match[0]
        place = path.relative_to(ROOT).as_posix()
        up = "../" * depth
        if place in places:
            return f"[{words}]({up}{places[place]}{anchor})"
        if place.startswith("docs/") and path.suffix in {".md", ".png", ".svg"}:
            return f"[{words}]({up}{place.removeprefix('docs/')}{anchor})"
        if path.is_dir() and place.startswith("docs/"):
            first = min(path.glob("*.md")).relative_to(ROOT / "docs").as_posix()
            return f"[{words}]({up}{first})"
        if path.exists():
            return f"{words} (`{place}`)"
        return match[0]

    return re.sub(r"\[([^\]]+)\]\(([^)#\s]+)(#[^)\s]*)?\)", link, text)
