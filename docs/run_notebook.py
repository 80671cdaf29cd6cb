"""Run docs/notebook.ipynb and keep its outputs in it: `make notebook`."""

from __future__ import annotations

from pathlib import Path

import nbformat
from nbclient import NotebookClient

from render.store.folder import write_text

NOTEBOOK = Path(__file__).resolve().parent / "notebook.ipynb"


def executed(path: Path = NOTEBOOK) -> nbformat.NotebookNode:
    """The notebook at `path`, run in its own folder; times are left out, so that the same outputs are the same file."""
    notebook = nbformat.read(path, as_version=4)
    client = NotebookClient(notebook, record_timing=False, resources={"metadata": {"path": str(path.parent)}})
    return client.execute()


if __name__ == "__main__":
    write_text(NOTEBOOK, nbformat.writes(executed()) + "\n")
