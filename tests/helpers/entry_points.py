"""An entry point of a package that nobody installed."""

from __future__ import annotations


class Entry:
    """What `importlib.metadata.entry_points` gives, as far as the table asks."""

    def __init__(self, name, content):
        self.name, self.value, self.content, self.loaded = name, f"elsewhere:{name}", content, 0

    def load(self):
        self.loaded += 1
        if isinstance(self.content, Exception):
            raise self.content
        return self.content
