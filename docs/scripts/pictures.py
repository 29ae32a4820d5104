"""Small PNG files for the pages."""

import io
from pathlib import Path

from PIL import Image

FIGURES = Path(__file__).parents[1] / "figures"


def put(picture, name):
    """Write a picture to docs/figures in 256 colours, which are enough for lines and text."""
    few = picture.convert("RGB").quantize(256, dither=Image.Dither.NONE)
    few.save(FIGURES / f"{name}.png", optimize=True)


def put_figure(figure, name, dpi=110):
    """Write a figure of matplotlib to docs/figures."""
    drawn = io.BytesIO()
    figure.savefig(drawn, dpi=dpi)
    with Image.open(drawn) as picture:
        put(picture, name)
