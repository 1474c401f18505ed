"""Colours and measures of the picture. B G R, as OpenCV wants them.

Orange, sky blue and green are Okabe and Ito's: they stay apart for every kind of colour vision.
"""

Colour = tuple[int, int, int]


def _bgr(code: str) -> Colour:
    red, green, blue = bytes.fromhex(code)
    return blue, green, red


BACKGROUND = _bgr("0b1420")
PANEL = _bgr("121f2f")
PANEL_EDGE = _bgr("22354a")
GRID = _bgr("1c2c3f")
TEXT = _bgr("eef3f8")
MUTED = _bgr("8ea2b8")
FAINT = _bgr("4b6077")
MEASURED = _bgr("f0a832")
INFERRED = _bgr("56b4e9")
KEYPOINT = _bgr("2ee6a8")
WATER = _bgr("2d6c9c")
BOX = _bgr("d5dfea")
BOW = _bgr("ffffff")
ALARM = _bgr("ff7a66")

WIDTH, HEIGHT = 1600, 900
MARGIN = 24.0
GAP = 14.0
TITLE_HEIGHT = 34.0
