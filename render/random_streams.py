"""Random numbers that depend on a key only: the same for any number of workers, in any order, and after a resume."""

from __future__ import annotations

import hashlib

import numpy as np

__all__ = ["random_stream"]


def random_stream(seed: int, key: str, stream: str, trial: int = 0) -> np.random.Generator:
    """Generator of one stream of one key in one trial: the same for any order, number of workers or resume."""
    words = hashlib.sha256(f"{key}/{stream}".encode()).digest()
    entropy = [seed, trial, *np.frombuffer(words, dtype=np.uint32).tolist()]
    return np.random.default_rng(np.random.SeedSequence(entropy))
