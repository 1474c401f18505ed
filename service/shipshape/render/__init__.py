"""One picture of one recognition, for people: what came in, what was made of it, and what it was taken for."""

from shipshape.render.canvas import Canvas, Font, Rect
from shipshape.render.cluster_panels import draw_cluster_from_above, draw_cluster_from_sensor
from shipshape.render.image_panels import draw_image, draw_layer_legend
from shipshape.render.restored_panels import (
    draw_point_legend,
    draw_restored_from_above,
    draw_restored_oblique,
)
from shipshape.render.style import (
    BACKGROUND,
    GAP,
    HEIGHT,
    MARGIN,
    PANEL,
    PANEL_EDGE,
    TEXT,
    TITLE_HEIGHT,
    WIDTH,
)
from shipshape.render.text_panels import draw_probabilities, draw_reasons, draw_stages, draw_title
from shipshape.types import Contact, Recognition

_TOP = 106.0
_FOOT_TOP = 716.0
_COLUMNS = ((MARGIN, 480.0), (518.0, 560.0), (1092.0, 484.0))  # left edge and width


def render_png(contact: Contact, recognition: Recognition) -> bytes:
    """The bytes of a PNG picture, 1600 x 900 pixels.

    Args:
        contact: The contact as it was sent, points in the level frame.
        recognition: What the pipeline said of it.
    """
    canvas = Canvas(WIDTH, HEIGHT, BACKGROUND)
    draw_title(canvas, Rect(MARGIN, 18.0, WIDTH - 2 * MARGIN, 80.0), contact, recognition)
    _draw_cluster(canvas, contact, recognition)
    _draw_images(canvas, recognition)
    _draw_restored(canvas, recognition)
    _draw_foot(canvas, recognition)
    return canvas.to_png()


def _draw_cluster(canvas: Canvas, contact: Contact, recognition: Recognition) -> None:
    x, width = _COLUMNS[0]
    above = _panel(canvas, Rect(x, _TOP, width, 356), "Cluster from above")
    draw_cluster_from_above(canvas, above, contact)
    seen = _panel(canvas, Rect(x, _TOP + 356 + GAP, width, 226), "Cluster as the LiDAR sees it")
    water_level = recognition.box.center_level[2] - recognition.box.size.height / 2
    draw_cluster_from_sensor(canvas, seen, contact, water_level)


def _draw_images(canvas: Canvas, recognition: Recognition) -> None:
    x, width = _COLUMNS[1]
    if (images := recognition.images) is None:
        rect = Rect(x, _TOP, width, _FOOT_TOP - GAP - _TOP)
        _frame(canvas, rect, "Not restored: time was short")
        return
    height = (_FOOT_TOP - GAP - _TOP - GAP) / 2
    for index, (title, image) in enumerate((("Image", images.before), ("Inpainted", images.after))):
        frame = Rect(x, _TOP + index * (height + GAP), width, height)
        area = _panel(canvas, frame, f"{title}, {image.shape[1]} × {image.shape[0]} pixels")
        draw_image(canvas, Rect(area.x, area.y - 8, area.width, area.height + 30), image)
        draw_layer_legend(canvas, frame.right - 16, frame.y + 23, recognition.image_method)


def _draw_restored(canvas: Canvas, recognition: Recognition) -> None:
    x, width = _COLUMNS[2]
    height = (_FOOT_TOP - GAP - _TOP - GAP) / 2
    upper = Rect(x, _TOP, width, height)
    title = "Measured" if recognition.images is None else "Restored"
    draw_restored_oblique(canvas, _panel(canvas, upper, title), recognition)
    draw_point_legend(canvas, upper.right - 16, upper.y + 23, recognition)
    lower = Rect(x, _TOP + height + GAP, width, height)
    draw_restored_from_above(canvas, _panel(canvas, lower, f"{title} from above, box and bow"), recognition)


def _draw_foot(canvas: Canvas, recognition: Recognition) -> None:
    height = HEIGHT - MARGIN - _FOOT_TOP
    split = 794.0
    left = Rect(MARGIN, _FOOT_TOP, split - MARGIN - GAP / 2, height)
    right = Rect(split + GAP / 2, _FOOT_TOP, WIDTH - MARGIN - split - GAP / 2, height)
    _frame(canvas, left, "Which vessel")
    draw_reasons(canvas, left.right - 16, left.y + 23, recognition)
    draw_probabilities(canvas, Rect(left.x + 16, left.y + 32, left.width - 32, height - 40), recognition)
    _frame(canvas, right, "Time, milliseconds a stage")
    draw_stages(canvas, Rect(right.x + 16, right.y + 34, right.width - 32, height - 42), recognition)


def _panel(canvas: Canvas, rect: Rect, title: str) -> Rect:
    """A framed panel; returns the area for a view, with room for a scale bar under it."""
    _frame(canvas, rect, title)
    return Rect(rect.x + 20, rect.y + TITLE_HEIGHT + 10, rect.width - 40, rect.height - TITLE_HEIGHT - 44)


def _frame(canvas: Canvas, rect: Rect, title: str) -> None:
    canvas.rectangle(rect, PANEL)
    canvas.outline(rect, PANEL_EDGE)
    canvas.text(title, (rect.x + 16, rect.y + 23), Font(TEXT, 14.0, 500))
