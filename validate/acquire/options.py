"""Where views are made: the options that all commands share. Loads neither Dask nor anything else that is slow."""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass
from typing import Annotated

import tyro

__all__ = ["HERE", "Scale"]


@dataclass(frozen=True)
class Scale:
    """Where views are rendered and measured: in this process, by worker processes here, or by a cluster.

    Args:
        workers: processes on this machine that each make one view at a time (default: this process renders).
        cluster: address of a running Dask scheduler, such as tcp://host:8786, whose workers make the views.
    """

    workers: Annotated[int | None, tyro.conf.arg(metavar="N")] = None
    cluster: Annotated[str | None, tyro.conf.arg(metavar="ADDRESS")] = None

    def check(self) -> None:
        """Report the user's mistakes before anything is done.

        Raises:
            RangeError: both options, or a number that is not allowed.
            MissingLibraryError: Dask is needed, and not there.
        """
        from pss import MissingLibraryError, RangeError

        if self == HERE:
            return
        if self.workers is not None and self.cluster is not None:
            raise RangeError(f"--workers {self.workers} and --cluster {self.cluster}; allowed: one of the two")
        if self.workers is not None and self.workers < 1:
            raise RangeError(f"--workers {self.workers}; allowed: 1 or more")
        if self.cluster is not None and "://" not in self.cluster:
            raise RangeError(f"--cluster {self.cluster}; allowed: an address such as tcp://host:8786")
        if importlib.util.find_spec("distributed") is None:
            option = f"--workers {self.workers}" if self.cluster is None else f"--cluster {self.cluster}"
            raise MissingLibraryError(f"{option} needs Dask: pip install 'pss-testbed[dask]'; without it, one process")


# As ever: one process renders, others measure.
HERE = Scale()
