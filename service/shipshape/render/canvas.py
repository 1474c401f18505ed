"""A drawing surface in picture pixels (y down), drawn twice as large and scaled down for smooth edges."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from shipshape.render.style import Colour

SCALE = 2  # drawn so much larger than shown

Point = tuple[float, float]


class Rect(NamedTuple):
    """A rectangle in picture pixels."""

    x: float
    y: float
    width: float
    height: float

    @property
    def right(self) -> float:
        """The x of its right edge."""
        return self.x + self.width

    @property
    def bottom(self) -> float:
        """The y of its lower edge."""
        return self.y + self.height

    @property
    def centre(self) -> Point:
        """Its middle."""
        return self.x + self.width / 2, self.y + self.height / 2

    def inset(self, by: float, top: float | None = None) -> "Rect":
        """The rectangle inside a margin, with another one at the top if given."""
        upper = by if top is None else top
        return Rect(self.x + by, self.y + upper, self.width - 2 * by, self.height - by - upper)


@dataclass(frozen=True, slots=True)
class Font:
    """How a text is set."""

    colour: Colour
    size: float = 13.0
    weight: int = 400  # 200 light to 800 bold
    anchor: str = "left"  # left, middle or right: what of the text stands at its position


class Canvas:
    """Draws with picture pixels; everything is clipped to the picture."""

    def __init__(self, width: int, height: int, background: Colour) -> None:
        self._image = np.empty((height * SCALE, width * SCALE, 3), np.uint8)
        self.rectangle(Rect(0.0, 0.0, width, height), background)
        self._font = cv2.FontFace("sans")

    def rectangle(self, rect: Rect, colour: Colour) -> None:
        """A filled rectangle."""
        corner, opposite = _scaled((rect.x, rect.y)), _scaled((rect.right, rect.bottom))
        cv2.rectangle(self._image, corner, opposite, colour, cv2.FILLED)

    def outline(self, rect: Rect, colour: Colour) -> None:
        """The edge of a rectangle, one pixel wide."""
        corner, opposite = _scaled((rect.x, rect.y)), _scaled((rect.right, rect.bottom))
        cv2.rectangle(self._image, corner, opposite, colour, SCALE)

    def line(self, points: Sequence[Point], colour: Colour, width: float = 1.0, *, closed: bool = False) -> None:
        """A line through `points`."""
        corners = np.array([_scaled(point) for point in points], np.int32)
        thickness = max(1, round(width * SCALE))
        cv2.polylines(self._image, [corners], closed, colour, thickness, cv2.LINE_AA)

    def polygon(self, points: Sequence[Point], colour: Colour, opacity: float = 1.0) -> None:
        """A filled polygon."""
        corners = np.array([_scaled(point) for point in points], np.int32)
        if opacity >= 1.0:
            cv2.fillPoly(self._image, [corners], colour, cv2.LINE_AA)
            return
        rows, columns = self._window(corners)
        beneath = self._image[rows, columns]
        coloured = beneath.copy()
        cv2.fillPoly(coloured, [corners - (columns.start, rows.start)], colour, cv2.LINE_AA)
        self._image[rows, columns] = cv2.addWeighted(coloured, opacity, beneath, 1 - opacity, 0)

    def arrow(self, start: Point, end: Point, colour: Colour, *, width: float = 2.0, head: float = 10.0) -> None:
        """An arrow with a filled head of `head` pixels."""
        along = np.subtract(end, start)
        length = max(float(np.hypot(*along)), 1e-6)
        along = along / length * head
        across = np.array([-along[1], along[0]]) * 0.45
        neck = np.subtract(end, along)
        self.line([start, (float(neck[0]), float(neck[1]))], colour, width)
        self.polygon([end, tuple(neck + across), tuple(neck - across)], colour)

    def dots(self, points: np.ndarray, colours: np.ndarray, radius: float) -> None:
        """Discs at `points` (N, 2), each of its own colour (N, 3), the later ones over the earlier."""
        centres = np.rint(points * SCALE).astype(int).tolist()
        size = max(1, round(radius * SCALE))
        for centre, colour in zip(centres, colours.tolist(), strict=True):
            cv2.circle(self._image, centre, size, colour, cv2.FILLED, cv2.LINE_AA)

    def ring(self, centre: Point, radius: float, colour: Colour, width: float = 1.5) -> None:
        """A circle."""
        thickness = max(1, round(width * SCALE))
        cv2.circle(self._image, _scaled(centre), round(radius * SCALE), colour, thickness, cv2.LINE_AA)

    def pixels(self, image: np.ndarray, rect: Rect) -> None:
        """An image (rows, columns, 3), every pixel a sharp block."""
        x, y = _scaled((rect.x, rect.y))
        width, height = round(rect.width * SCALE), round(rect.height * SCALE)
        blocks = cv2.resize(image, (width, height), interpolation=cv2.INTER_NEAREST)
        self._image[y : y + height, x : x + width] = blocks

    def text(self, text: str, position: Point, font: Font) -> float:
        """One line of text on the baseline at `position`; returns its width."""
        text = _drawable(text)
        width = self.text_width(text, font)
        shift = {"left": 0.0, "middle": width / 2, "right": width}[font.anchor]
        origin = _scaled((position[0] - shift, position[1]))
        size = round(font.size * SCALE)
        cv2.putText(self._image, text, origin, font.colour, self._font, size, font.weight)
        return width

    def text_width(self, text: str, font: Font) -> float:
        """Width of a line of text."""
        size = round(font.size * SCALE)
        left, _, width, _ = cv2.getTextSize((0, 0), _drawable(text), (0, 0), self._font, size, font.weight)
        return float(left + width) / SCALE

    def _window(self, corners: np.ndarray) -> tuple[slice, slice]:
        """Rows and columns around `corners`, within the picture."""
        height, width = self._image.shape[:2]
        (left, top), (right, bottom) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
        rows = slice(min(max(top - 2, 0), height - 1), min(max(bottom + 3, 1), height))
        return rows, slice(min(max(left - 2, 0), width - 1), min(max(right + 3, 1), width))

    def to_png(self) -> bytes:
        """The picture as the bytes of a PNG file."""
        small = cv2.resize(self._image, None, fx=1 / SCALE, fy=1 / SCALE, interpolation=cv2.INTER_AREA)
        _, encoded = cv2.imencode(".png", small)
        return encoded.tobytes()


def _scaled(point: Point) -> tuple[int, int]:
    return round(point[0] * SCALE), round(point[1] * SCALE)


def _drawable(text: str) -> str:
    """`text` without lone surrogates, on which OpenCV ends the process."""
    return text.encode("utf-8", "replace").decode()
