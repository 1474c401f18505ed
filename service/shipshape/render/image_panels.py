"""The projected image before and after inpainting, every pixel a block."""

import numpy as np

from shipshape.render.canvas import Canvas, Font, Rect
from shipshape.render.style import BACKGROUND, FAINT, MUTED, PANEL_EDGE, Colour
from shipshape.types import ImageMethod

_LAYER_COLOURS: tuple[Colour, ...] = ((255, 120, 60), (80, 220, 90), (80, 90, 255))
_TOP_LAYERS = ("lower", "middle", "upper")
_SIDE_LAYERS = ("starboard", "middle", "port")  # the side view is divided across the vessel
_SIDE_VIEWS = (ImageMethod.FULL_SIDE, ImageMethod.Z_SIDE)


def draw_image(canvas: Canvas, area: Rect, image: np.ndarray) -> None:
    """`image` (rows, columns, 3) as large as whole blocks allow, its empty cells the picture's background."""
    rows, columns = image.shape[:2]
    block = max(min(int(2 * area.width) // columns, int(2 * area.height) // rows), 1) / 2
    width, height = min(columns * block, area.width), min(rows * block, area.height)
    frame = Rect(area.x + (area.width - width) / 2, area.y + (area.height - height) / 2, width, height)
    canvas.pixels(_displayed(image), frame)
    canvas.outline(frame, PANEL_EDGE)


def _displayed(image: np.ndarray) -> np.ndarray:
    """In each cell the layer nearest to the viewer, in its colour, from a visible least value up.

    Mixing the layers would say more and show less: three bright colours add up to white.
    """
    filled = image > 0
    nearest = image.shape[2] - 1 - np.argmax(filled[:, :, ::-1], axis=2)
    value = np.take_along_axis(image, nearest[:, :, None], axis=2)
    shown = np.array(_LAYER_COLOURS, np.float64)[nearest] * (0.4 + 0.6 / 255 * value)
    return np.where(filled.any(axis=2, keepdims=True), shown, BACKGROUND).astype(np.uint8)


def draw_layer_legend(canvas: Canvas, right: float, y: float, method: ImageMethod | None) -> None:
    """Which colour is which layer of an image of `method` (None: the top view of preset best), up to `right`."""
    names = _SIDE_LAYERS if method in _SIDE_VIEWS else _TOP_LAYERS
    font = Font(MUTED, 12.0, anchor="right")
    for name, colour in reversed(list(zip(names, _LAYER_COLOURS, strict=True))):
        right -= canvas.text(name, (right, y), font) + 8
        canvas.rectangle(Rect(right - 6, y - 9, 9, 9), colour)
        right -= 20
    canvas.text("nearest layer", (right, y), Font(FAINT, 12.0, anchor="right"))
