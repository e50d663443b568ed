# Copyright 2026 ride_estimation contributors
"""Write the gallery: one page per cause, each with the diagnosis of a run in which an independent plant hides that cause.

    python docs/gallery/make.py                      every page
    python docs/gallery/make.py bump_stop backlash   some

The runs are those of ``test/worlds``: a cab on four mounts, accelerometers with noise on cab and mount bases, laws of other
forms than those of the diagnosis. What a page says of its run comes from the diagnosis, right or wrong.
"""

from __future__ import annotations

import argparse
import pathlib
import sys
import tempfile
from typing import Any

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "test"))

from PIL import Image
from worlds.scenario import make_scenario
from worlds.store import StoredCase, load_case, save_case

from ride_estimation.diagnosis.causes import library
from ride_estimation.diagnosis.diagnose import diagnose
from ride_estimation.reporting.diagnosis_report import residual_spectrum, stretch

FOLDER = pathlib.Path(__file__).parent
SEED, DURATION_S, RESIDUAL, NOISE = 4100, 40.0, 0.15, 0.02

#: what an engineer sees
LOOKS = {
    "backlash": (
        "The mount carries nothing near its rest position: small motion is softer than large motion, and the error "
        "jumps where the gap closes."
    ),
    "bump_stop": (
        "The error is zero on most of the run and large in the few blocks with the largest deflection; then it has "
        "one sign."
    ),
    "cg_offset": (
        "Vertical motion turns the body: the errors of front and rear, or left and right, have opposite signs and the "
        "shape of the vertical acceleration."
    ),
    "coulomb_friction": (
        "The loop of force over deflection is a parallelogram and not an ellipse. Small motion looks stiff, large "
        "motion looks as modelled; the error is a rectangle with the sign of the deflection rate."
    ),
    "damping_nonlinearity": (
        "The error follows the deflection rate, and its size over the rate changes with speed or with direction."
    ),
    "flexible_mode": (
        "A narrow peak in the error where no rigid-body mode is, with opposite signs at different sensors of the "
        "body."
    ),
    "harmonic_disturbance": (
        "A line in the spectrum of the error that the road does not excite; it stays when the vehicle stands with its "
        "engine running."
    ),
    "mass_change": (
        "All mounts seem softer and less damped by one factor, from the start or from an instant on; modes shift down "
        "together."
    ),
    "missing_degree_of_freedom": (
        "A resonance with its antiresonance in the error: something on the body moves on its own (a seat, a tank, a "
        "pump)."
    ),
    "one_soft_mount": (
        "The error at one corner follows its deflection over the whole band, the other corners fit."
    ),
    "parameter_drift": (
        "The error grows (or falls) along the run while its shape stays."
    ),
    "sensor_bias": (
        "A constant error of one axis beyond what turning the sensor explains."
    ),
    "sensor_clipping": (
        "The error of one sensor sits at its largest readings, which end at one level."
    ),
    "sensor_delay": (
        "The error of one sensor grows with frequency and is the derivative of its reading."
    ),
    "sensor_gain": (
        "The error of one axis has the shape of its reading, over the whole band."
    ),
    "sensor_misalignment": (
        "One axis of a sensor reads a part of another one, gravity included."
    ),
    "stiffness_nonlinearity": (
        "The error follows a power of the deflection; it has three times the frequency of the motion, or twice where "
        "the law is one-sided."
    ),
    "viscoelasticity": (
        "Stiffness grows with frequency while the loss moves: a linear spring and damper fit one frequency and miss "
        "the others."
    ),
    "wrong_sensor_position": (
        "The error of one sensor has the shape of the angular acceleration."
    ),
}


def case(cause: str, seed: int) -> StoredCase:
    """Return the run that hides a cause, and a second one for validation."""
    made = make_scenario((cause,), seed, residual=RESIDUAL, noise=NOISE, duration=DURATION_S)
    with tempfile.TemporaryDirectory() as folder:
        save_case(pathlib.Path(folder) / "case.npz", made)
        return load_case(pathlib.Path(folder) / "case.npz")


def page(cause: str, seed: int) -> str:
    """Diagnose the run of a cause, draw what is left, return the page."""
    hidden = case(cause, seed)
    planted: Any = hidden.facts["planted"]
    found = diagnose(hidden.vehicle, hidden.run, validation=list(hidden.validation))
    lines = [f"# `{cause}`", "", LOOKS[cause], ""]
    place = " ".join(word for word in (planted[0]["location"], planted[0]["axis"]) if word)
    lines += [
        f"**Hidden in this run:** `{planted[0]['form'] or cause}` at {place or 'the body'}; the best linear model leaves "
        f"{100.0 * planted[0]['residual']:.0f} % of the response.",
        "",
        f"**What `diagnose` says:** {found.sentence}",
        "",
    ]
    if found.evidence is not None:
        for name, draw, words in (
            ("stretch", stretch, "The channel that the calibrated linear model misses most, and what is left by both models"),
            ("spectrum", residual_spectrum, "Spectrum of what is left, with the noise that the sensors are known to have"),
        ):
            picture = FOLDER / f"{cause}_{name}.png"
            draw(found.evidence).savefig(picture, dpi=80, bbox_inches="tight")
            with Image.open(picture) as full:
                full.quantize(32).save(picture, optimize=True)  # a third of the size
            lines += [f"![{words}]({cause}_{name}.png)", ""]
    for named in found.causes[:1]:
        lines += [f"**Would refute it:** {named.would_refute}.", "", f"**Measure next:** {named.measure_next}.", ""]
    return "\n".join(lines)


def index() -> str:
    """Return the page that lists the others."""
    rows = [f"| [`{cause}`]({cause}.md) | {LOOKS[cause]} |" for cause in library()]
    return "\n".join([
        "# Gallery: what each cause looks like",
        "",
        "One page per cause that `diagnose` knows: what it does to the error of a linear simulation, and the diagnosis of a run",
        "in which an independent simulation hides it. `docs/gallery/make.py` writes these pages, wrong answers included.",
        "",
        "| cause | what the error looks like |",
        "|---|---|",
        *rows,
        "",
        "```{toctree}",
        ":hidden:",
        *library(),
        "```",
        "",
    ])  # fmt: skip


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("causes", nargs="*", help="default: all")
    parser.add_argument("--seed", type=int, default=SEED)
    options = parser.parse_args()
    (FOLDER / "index.md").write_text(index(), encoding="utf-8")
    for cause in options.causes or library():
        (FOLDER / f"{cause}.md").write_text(page(cause, options.seed), encoding="utf-8")
        print(cause, flush=True)


if __name__ == "__main__":
    main()
