# Copyright 2026 ride_estimation contributors
import json
import math

import numpy as np

from ride_estimation.estimation.common.estimate import Status
from ride_estimation.io.json_file import write_json


def test_numpy_enums_and_non_finite_numbers_become_valid_json(tmp_path):
    document = {
        "a": np.float64(1.5), "b": np.arange(3), "c": math.inf, "d": (1, np.nan), "e": Status.VALID, "f": np.bool_(True), 7: "x",
    }
    write_json(tmp_path / "x.json", document)
    text = (tmp_path / "x.json").read_text()
    assert json.loads(text) == {"a": 1.5, "b": [0, 1, 2], "c": None, "d": [1, None], "e": "valid", "f": True, "7": "x"}
    assert text.endswith("\n")
