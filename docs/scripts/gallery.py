#!/usr/bin/env python
"""Run the studies of the gallery and copy the figures of their reports that its pages show.

python docs/scripts/gallery.py [STUDY ...]

Without names it runs those that take less than half a minute. A run that is there already is not made again:
remove results/<study> for that. Figures go to docs/figures, in 256 colours, and a small one for the index.
"""

import subprocess
import sys
from pathlib import Path

from pictures import FIGURES, put
from PIL import Image, ImageOps

ROOT = Path(__file__).parents[2]

SHOWN = {
    "mode_coupling": {
        "sampled-lock_in": "gallery-mode_coupling-lock_in",
        "drivers-indices_any_unstable": "gallery-mode_coupling-drivers",
        "frequency-probability_over": "gallery-mode_coupling-frequency",
        "damping-stability_map": "gallery-mode_coupling-damping",
    },
    "oberst2016": {
        "calibrated-occurrence": "occurrence",
        "calibrated-lock_in": "gallery-oberst2016-lock_in",
        "calibrated-mode_shapes": "gallery-oberst2016-mode_shapes",
        "damping_sweep-probability_over_damping": "gallery-oberst2016-damping",
    },
    "scatter": {
        "damping_sweep-probability_over_damping": "gallery-scatter-damping",
        "monte_carlo_integrated-fragility": "gallery-scatter-fragility",
    },
    "squeak_report": {
        "lubrication-probability_over_damping": "gallery-squeak_report-damping",
        "map-stability_map": "gallery-squeak_report-map",
        "onset-onsets": "gallery-squeak_report-onsets",
        "drivers-indices_any_unstable": "gallery-squeak_report-drivers",
        "patterns-by_count": "gallery-squeak_report-by_count",
    },
}
"""Study -> figure of its report -> what it is called in docs/figures."""

THUMBNAILS = {  # of the figure with this name
    "mode_coupling": "gallery-mode_coupling-damping",
    "oberst2016": "occurrence",
    "scatter": "gallery-scatter-fragility",
    "squeak_report": "gallery-squeak_report-damping",
    "method_comparison": "methods-error",
}
PANEL = {"method_comparison": (0.0, 0.1, 0.5, 1.0)}
"""Study -> part of that figure to show: left, top, right, bottom, of its width and height."""
QUICK = ("mode_coupling", "oberst2016")
SIZE = (480, 320)


def main():
    """Run, copy, and make the small figures again."""
    for study in sys.argv[1:] or QUICK:
        if study not in SHOWN:
            sys.exit(f"{study} is none of {', '.join(SHOWN)}")
        out = ROOT / "results" / study
        command = ["-m", "hipuq", "run", ROOT / "studies" / study, "--out", out, "--resume"]
        subprocess.run([sys.executable, *command], check=True)
        for figure, name in SHOWN[study].items():
            with Image.open(out / "figures" / f"{figure}.png") as picture:
                put(picture, name)
    for study, name in THUMBNAILS.items():
        with Image.open(FIGURES / f"{name}.png") as picture:
            box = PANEL.get(study, (0.0, 0.0, 1.0, 1.0))
            part = picture.convert("RGB").crop(
                tuple(round(a * b) for a, b in zip(box, picture.size * 2, strict=True))
            )
            small = ImageOps.pad(part, SIZE, Image.Resampling.LANCZOS, color="white")
        put(small, f"gallery-{study}")


if __name__ == "__main__":
    main()
