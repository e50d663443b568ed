# Copyright 2026 ride_estimation contributors
"""Mutations of file contents: what transfer errors, crashes and a hostile hand make of a good file."""

from __future__ import annotations

import random
from collections.abc import Sequence

#: numbers at the borders of what readers expect of lengths, counts, offsets and values
_NUMBERS = (0, 1, 2, 127, 128, 255, 256, 32767, 65535, 65536, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1, 2**63, 2**64 - 1)
_LARGEST = 1 << 17


def mutated(data: bytes, others: Sequence[bytes], words: Sequence[bytes], rng: random.Random) -> bytes:
    """Return ``data`` after one to eight random changes.

    Parameters
    ----------
    data
        A good file.
    others
        Files parts may be taken from.
    words
        Pieces that mean something in the format.
    rng
        Decides everything: the same generator gives the same file.
    """
    out = bytearray(data)
    for _ in range(1 << rng.randrange(4)):
        _change(out, others, words, rng)
    return bytes(out[:_LARGEST])


def _change(out: bytearray, others: Sequence[bytes], words: Sequence[bytes], rng: random.Random) -> None:
    kind, size = rng.randrange(10), len(out)
    at = rng.randrange(size) if size else 0
    if not size or kind == 0:  # a word of the format
        if words:
            word = rng.choice(words)
            out[at : at + rng.choice((0, len(word)))] = word
        return
    if kind == 1:
        out[at] ^= 1 << rng.randrange(8)
    elif kind == 2:
        out[at] = rng.randrange(256)
    elif kind == 3:  # a number at a border, either byte order
        width = rng.choice((1, 2, 4, 8))
        number = rng.choice(_NUMBERS) % (1 << (8 * width))
        out[at : at + width] = number.to_bytes(width, rng.choice(("little", "big")))
    elif kind == 4:
        del out[at:]
    elif kind == 5:
        del out[at : at + rng.randrange(1, 1 + min(size, 64))]
    elif kind == 6:  # a piece twice
        piece = bytes(out[at : at + rng.randrange(1, 1 + min(size, 256))])
        out[at:at] = piece * rng.choice((1, 1, 2, 16))
    elif kind == 7:  # a piece of another file
        other = rng.choice(others) if others else b""
        start = rng.randrange(len(other)) if other else 0
        out[at:at] = other[start : start + rng.randrange(1, 257)]
    elif kind == 8:  # a damaged sector
        width = rng.randrange(1, 1 + min(size, 512))
        out[at : at + width] = rng.choice((bytes(width), b"\xff" * width, rng.randbytes(width)))
    else:  # two pieces change places
        to, width = rng.randrange(size), rng.randrange(1, 1 + min(size, 64))
        first, second = bytes(out[at : at + width]), bytes(out[to : to + width])
        out[at : at + width] = second
        out[to : to + width] = first
