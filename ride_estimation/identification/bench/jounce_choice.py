# Copyright 2026 ride_estimation contributors
"""Size and ridge of the jounce-bumper grey box, chosen on records it did not see; and whether the white box does better there.

A network of document 004's M = 10 local models fits what it is trained on and may be far off on another road. So every dynamic
record is left out in turn, or, where there is only one, every fourth of its load events.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ride_estimation.errors import InputDataError
from ride_estimation.identification.bench.jounce import identify_white_box
from ride_estimation.identification.bench.jounce_model import Load, WhiteBox, loaded_nrmse
from ride_estimation.identification.bench.lolimot import RIDGES, Network, NetworkInputs, train_network

Array = NDArray[np.float64]

#: most local models that are tried (document 004: M = 10)
LARGEST = 10
#: error on records left out over that of the white box beyond which the network is no element to be used
ACCEPTED_RATIO = 1.5


@dataclasses.dataclass(frozen=True)
class NetworkChoice:
    """What the records left out say.

    Attributes
    ----------
    models, ridge
        The size and the ridge with the least error.
    sizes
        Number of local models -> error on records left out, with the best ridge for it.
    left_out
        Record left out -> error of the choice on it, NRMSE while loaded.
    white
        Record left out -> error of the white box on it.
    unseen, white_unseen
        Record of no part in the choice -> error of the network on it, and of the white box fitted to the same records.
    """

    models: int
    ridge: float
    sizes: dict[int, float]
    left_out: dict[str, float]
    white: dict[str, float]
    unseen: dict[str, float] = dataclasses.field(default_factory=dict)
    white_unseen: dict[str, float] = dataclasses.field(default_factory=dict)

    @property
    def refusal(self) -> str:
        """Return why the network should not be used, empty where it may."""
        own, white = (float(np.mean(list(scores.values()))) for scores in (self.left_out, self.white))
        where = "records left out in turn"
        if own <= ACCEPTED_RATIO * white:
            where = max(self.unseen, key=lambda name: self.unseen[name] / self.white_unseen[name], default="")
            if not where or self.unseen[where] <= ACCEPTED_RATIO * self.white_unseen[where]:
                return ""
            own, white = self.unseen[where], self.white_unseen[where]
        return (
            f"on {where} the network is {100 * own:.3g} % off, the white box {100 * white:.3g} %: it does not "
            "carry over to what it was not trained on; use --model jounce_bumper, or train it on more roads"
        )


@dataclasses.dataclass(frozen=True)
class _Fold:
    """Indices of the records to train on, the one to score, and which of its samples count (None: the loaded ones)."""

    train: tuple[int, ...]
    test: int
    part: NDArray[np.bool_] | None


def choose_network(
    inputs: Sequence[NetworkInputs],
    dynamic: Sequence[int],
    static: Sequence[Load],
    add: Callable[[Load], Array],
    models: int | None,
    progress: Callable[[float], None] | None = None,
) -> NetworkChoice:
    """Choose the number of local models and the ridge on records left out in turn.

    Parameters
    ----------
    inputs
        All records the network is to be trained on.
    dynamic
        Indices of the dynamic ones: these are left out in turn.
    static
        Slow records: the white box needs them.
    add
        Force that other elements add to that of the network [N].
    models
        Number of local models, None to choose it.
    progress
        Called with 1 per fold.

    Raises
    ------
    InputDataError
        One dynamic record with fewer than four load events: nothing can be left out.
    """
    folds = _folds(inputs, dynamic)
    scores = np.zeros((len(folds), len(RIDGES), models or LARGEST))
    white = {}
    for i, fold in enumerate(folds):
        train = [inputs[k] for k in fold.train]
        item = inputs[fold.test]
        rest = add(item.load)
        for j, ridge in enumerate(RIDGES):
            sizes: list[float] = []

            def note(network: Network, item: NetworkInputs = item, rest: Array = rest, sizes: list[float] = sizes,
                     part: NDArray[np.bool_] | None = fold.part) -> None:  # fmt: skip
                sizes.append(loaded_nrmse(item.load, network.force(item) + rest, part))

            train_network(train, models or LARGEST, ridge, each=note)
            scores[i, j] = sizes
        box = white_box_of(static, [t.load for t in train])
        white[item.load.name] = loaded_nrmse(item.load, box.force(item.load), fold.part)
        if progress is not None:
            progress(1.0)
    mean = scores.mean(axis=0)
    if models is not None:
        mean[:, : models - 1] = np.inf
    ridge_at, size_at = np.unravel_index(int(np.argmin(mean)), mean.shape)
    return NetworkChoice(
        int(size_at) + 1,
        RIDGES[ridge_at],
        {n + 1: float(v) for n, v in enumerate(mean.min(axis=0)) if np.isfinite(v)},
        {inputs[fold.test].load.name: float(scores[i, ridge_at, size_at]) for i, fold in enumerate(folds)},
        white,
    )


def white_box_of(static: Sequence[Load], loads: Sequence[Load]) -> WhiteBox:
    """Return the white box of slow records and those a network is trained on, which may be among them."""
    known = {load.name: load for load in (*static, *loads)}
    return identify_white_box(list(known.values()))[0]


def _folds(inputs: Sequence[NetworkInputs], dynamic: Sequence[int]) -> list[_Fold]:
    everything = tuple(range(len(inputs)))
    if len(dynamic) > 1:
        return [_Fold(tuple(k for k in everything if k != test), test, None) for test in dynamic]
    load = inputs[dynamic[0]].load
    if not load.held_out.any():
        raise InputDataError(
            f"{load.name}: one dynamic record with fewer than four load events: nothing can be left out to choose a network by; "
            "give more records, or use --model jounce_bumper"
        )
    return [_Fold(everything, dynamic[0], load.held_out)]
