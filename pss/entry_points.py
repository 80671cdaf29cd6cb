"""Tables of metrics and noise models by name, which installed packages extend by entry points."""

from __future__ import annotations

import importlib.metadata
import warnings
from abc import abstractmethod
from collections.abc import Iterable, Iterator, Mapping
from typing import TypeVar

from pss.errors import RangeError

__all__ = ["EntryPointTable"]

T = TypeVar("T")


class EntryPointTable(Mapping[str, T]):
    """Items by name: the project's, then those of installed entry points, which are loaded once, when needed.

    Args:
        group: of the entry points.
        noun: kind of the items in messages, such as "metric".
        own: names and items of the project.

    Raises:
        RangeError: two items have one name.
    """

    def __init__(self, group: str, noun: str, own: Iterable[tuple[str, T]]) -> None:
        self._group, self._noun = group, noun
        pairs = list(own)
        self._items = dict(pairs)
        if len(self._items) != len(pairs):
            raise RangeError(f"two {noun}s have one name; allowed: names that differ")
        self._own = len(pairs)
        self._complete = False

    def __getitem__(self, name: str) -> T:
        if name not in self._items:
            self._load()
        if name not in self._items:
            raise KeyError(f"{self._noun} {name!r}; allowed: {', '.join(self._items)}")
        return self._items[name]

    def __iter__(self) -> Iterator[str]:
        self._load()
        return iter(self._items)

    def __len__(self) -> int:
        self._load()
        return len(self._items)

    @property
    def own(self) -> tuple[str, ...]:
        """Names of the project's items."""
        return tuple(self._items)[: self._own]

    def of_entry_points(self) -> tuple[T, ...]:
        """The items of installed entry points, in their order."""
        self._load()
        return tuple(self._items.values())[self._own :]

    def reload_entry_points(self) -> None:
        """Load entry points again at the next access, after a package was installed or removed."""
        self._items = {name: self._items[name] for name in self.own}
        self._complete = False

    @abstractmethod
    def _items_of(self, name: str, loaded: object) -> Iterable[tuple[str, T]]:
        """Names and items of the object that the entry point called `name` loads.

        Raises:
            RangeError: it is not an item of this table.
        """

    def _load(self) -> None:
        if self._complete:
            return
        self._complete = True
        for entry in importlib.metadata.entry_points(group=self._group):
            try:
                for name, item in self._items_of(entry.name, entry.load()):
                    if name in self._items:
                        raise RangeError(f"{self._noun} {name!r} is there already; allowed: another name")
                    self._items[name] = item
            except Exception as error:  # third-party code: a broken package must not disable the others
                warnings.warn(f"{self._noun}s of entry point {entry.name!r} ({entry.value}): {error}", stacklevel=2)
