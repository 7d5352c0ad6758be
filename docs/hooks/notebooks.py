"""Pages of the notebooks: each is run when the site is built, and shown with what it says then."""

import re
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import nbformat
from nbclient import NotebookClient

NOTEBOOKS = Path(__file__).parents[1] / "notebooks"
PATIENCE_S = 600


def notebook_pages() -> dict[str, str]:
    """Markdown of each notebook with its outputs, by the name of the page."""
    paths = sorted(NOTEBOOKS.glob("*.ipynb"))
    return {path.stem.replace("_", "-") + ".md": notebook_page(run_notebook(path)) for path in paths}


def run_notebook(path: Path) -> Any:
    """The notebook with the outputs of its cells, run from the top in a folder of its own.

    Raises
    ------
    nbclient.exceptions.CellExecutionError
        If a cell fails.
    """
    notebook = nbformat.read(path, as_version=4)
    with TemporaryDirectory() as folder:
        NotebookClient(notebook, timeout=PATIENCE_S, resources={"metadata": {"path": folder}}).execute()
    return notebook


def notebook_page(notebook: Any) -> str:
    """Markdown: texts as they are, code in blocks, and under each what it gave."""
    return "\n\n".join(part for cell in notebook.cells for part in _parts(cell)) + "\n"


def _parts(cell: Any) -> Iterator[str]:
    if cell.cell_type == "markdown":
        yield cell.source
        return
    yield f"```python\n{cell.source}\n```"
    for output in cell.outputs:
        data = output.get("data", {})
        if "text/html" in data:
            one_line = re.sub(r"\s*\n\s*", " ", data["text/html"])  # an empty line would end the HTML in Markdown
            yield f'<div class="result">{one_line}</div>'
        elif text := data.get("text/plain") or output.get("text"):
            yield f"```text\n{text.rstrip()}\n```"
