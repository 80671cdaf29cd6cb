"""Where a run takes its views from: a store, and the backend that renders what the store lacks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

from render import backend
from render.store.folder import Store
from render.store.remote import open_store
from validate.acquire.acquire import acquire, with_whole_views
from validate.acquire.messages import RunMessages
from validate.acquire.options import HERE, Scale
from validate.acquire.quality_warnings import warn_of_darkness, warn_of_render_noise, warn_of_saturation
from validate.acquire.request import Acquired, Acquisition
from validate.runs.exit_codes import EXIT_DONE, EXIT_FAILED

__all__ = ["ViewSource", "end_run", "open_source", "warn_of_quality"]

T = TypeVar("T")


@dataclass(frozen=True)
class ViewSource:
    """The one way from requested views to measured ones, for all commands.

    Attributes:
        store: of views, solved light and measurements.
        address: of the store, as the user gave it.
        backend: Mitsuba's variant, which renders.
        messages: of the run; they count the views of each pass.
        scale: where views are rendered and measured.
    """

    store: Store
    address: str
    backend: backend.Backend
    messages: RunMessages
    scale: Scale = HERE

    @property
    def renderer(self) -> str:
        """Identity of the backend, a part of each view's name."""
        return self.backend.identity

    def acquire(self, requested: Sequence[Acquisition]) -> Acquired:
        """Render and measure what the store lacks, and load the rest (`validate.acquire.acquire.acquire`)."""
        return acquire(requested, self.store, self.backend, self.messages, self.scale)

    def with_whole_views(self, use: Callable[[], T], requested: Sequence[Acquisition]) -> T:
        """What `use` returns, which reads views of the store; damaged ones are rendered again before another try."""
        return with_whole_views(use, requested, self.store, self.backend, self.messages, self.scale)


def open_source(address: str, variant: str | None, messages: RunMessages, scale: Scale = HERE) -> ViewSource:
    """Choose the backend, print which one it is, and open the store.

    Args:
        address: a store's folder, or an address that fsspec supports.
        variant: Mitsuba's variant; None for LLVM if a libLLVM is found, else scalar.

    Raises:
        MissingLibraryError: the variant or the address needs a library that is missing.
        StoreError: the address is not one that fsspec can use.
    """
    chosen = backend.choose(variant)
    messages.console.print(str(chosen), markup=False)
    return ViewSource(open_store(address), address, chosen, messages, scale)


def warn_of_quality(
    requested: Sequence[Acquisition], acquired: Acquired, messages: RunMessages, names: dict[str, str]
) -> None:
    """Warn of views with too much sampling noise, too many saturated pixels, or too little light.

    Args:
        names: what people call the views, by their hashes.
    """
    warn_of_render_noise(requested, acquired, messages.warn, names)
    warn_of_saturation(requested, acquired, messages.warn, names)
    warn_of_darkness(requested, acquired, messages.warn, names)


def end_run(line: str, acquired: Acquired, messages: RunMessages) -> int:
    """Print the run's last line; return the exit code, which reports whether a view failed."""
    return messages.end(EXIT_FAILED if acquired.failed else EXIT_DONE, line, acquired)
