"""The words and bars: title, class probabilities, and where the milliseconds went."""

import math
from dataclasses import replace

import cv2
import numpy as np

from shipshape.bundle import UNKNOWN
from shipshape.render.canvas import Canvas, Font, Rect
from shipshape.render.style import ALARM, FAINT, GRID, INFERRED, MEASURED, MUTED, TEXT, Colour
from shipshape.types import Contact, Recognition

_MAX_BARS = 6
_TITLE_WIDTH = 600.0


def vessel_title(recognition: Recognition) -> tuple[str, str]:
    """`pilot boat` and nothing more, or `unknown` and `most like pilot boat`."""
    name = _spoken(recognition.vessel)
    return (UNKNOWN, f"most like {name}") if recognition.unknown else (name, "")


def draw_title(canvas: Canvas, area: Rect, contact: Contact, recognition: Recognition) -> None:
    """What it is on the left; how it lies and how large it is on the right."""
    title, note = vessel_title(recognition)
    name = Font(ALARM if recognition.unknown else TEXT, 38.0, 600)
    name = replace(name, size=name.size * min(1.0, _TITLE_WIDTH / canvas.text_width(title, name)))
    width = canvas.text(title, (area.x, area.y + 42), name)
    shown = recognition.probabilities[UNKNOWN] if recognition.unknown else recognition.probability
    width += 18 + canvas.text(f"{shown:.1%}", (area.x + width + 18, area.y + 42), Font(MEASURED, 30.0, 500))
    canvas.text(_cut(note, 32), (area.x + width + 18, area.y + 42), Font(MUTED, 20.0))
    canvas.text(_provenance(contact, recognition), (area.x, area.y + 66), Font(MUTED, 13.0))
    x = area.right
    for label, value, remark in reversed(_facts(recognition)):
        column = max(
            canvas.text_width(value, Font(TEXT, 24.0, 500)), canvas.text_width(remark, Font(MUTED, 12.0)), 60
        )
        x -= column
        canvas.text(label, (x, area.y + 12), Font(FAINT, 12.0, 500))
        canvas.text(value, (x, area.y + 42), Font(TEXT, 24.0, 500))
        canvas.text(remark, (x, area.y + 64), Font(MUTED, 12.0))
        x -= 34


def draw_probabilities(canvas: Canvas, area: Rect, recognition: Recognition) -> None:
    """A bar for each of the most probable classes."""
    ranked = sorted(recognition.probabilities.items(), key=lambda item: -item[1])
    row = area.height / _MAX_BARS
    for index, (name, probability) in enumerate(ranked[:_MAX_BARS]):
        y = area.y + (index + 0.5) * row
        font = Font(TEXT if index == 0 else MUTED, 13.0, 500 if index == 0 else 400, anchor="right")
        canvas.text(_cut(_spoken(name), 20), (area.x + 150, y + 5), font)
        track = Rect(area.x + 164, y - 6, area.width - 164 - 66, 12)
        canvas.rectangle(track, GRID)
        if probability >= 0.001:
            colour = MEASURED if index == 0 else INFERRED
            canvas.rectangle(track._replace(width=track.width * min(probability, 1.0)), colour)
        canvas.text(f"{probability:.1%}", (area.right, y + 5), font)


def draw_reasons(canvas: Canvas, right: float, baseline: float, recognition: Recognition) -> None:
    """Why to trust the answer less, in one line that ends at `right`."""
    words = "   ·   ".join(_spoken(reason) for reason in recognition.reasons)
    canvas.text(words, (right, baseline), Font(ALARM, 13.0, 500, anchor="right"))


def draw_stages(canvas: Canvas, area: Rect, recognition: Recognition) -> None:
    """One bar as long as the whole pipeline, a piece for each stage, and the milliseconds in words."""
    total = sum(recognition.stage_ms.values())
    width = canvas.text(f"{total:.1f} ms", (area.x, area.y + 26), Font(TEXT, 26.0, 600))
    canvas.text("for the whole contact", (area.x + width + 12, area.y + 26), Font(MUTED, 13.0))
    x, y = area.x, area.y + 40
    stages = list(zip(recognition.stage_ms.items(), _stage_colours(len(recognition.stage_ms)), strict=True))
    for (_, ms), colour in stages:
        width = area.width * ms / total if total > 0 else 0.0
        canvas.rectangle(Rect(x, y, width, 14), colour)
        x += width
    columns = 3
    step = area.width / columns
    for index, ((name, ms), colour) in enumerate(stages):
        left = area.x + (index % columns) * step
        baseline = y + 36 + (index // columns) * 19
        canvas.rectangle(Rect(left, baseline - 9, 9, 9), colour)
        canvas.text(_spoken(name), (left + 16, baseline), Font(MUTED, 12.0))
        canvas.text(f"{ms:.2f}", (left + step - 24, baseline), Font(TEXT, 12.0, 500, anchor="right"))


def _stage_colours(count: int) -> list[Colour]:
    shares = np.linspace(60, 240, max(count, 1)).astype(np.uint8)
    colours = cv2.applyColorMap(shares, cv2.COLORMAP_VIRIDIS).reshape(-1, 3).tolist()
    return [(int(blue), int(green), int(red)) for blue, green, red in colours[:count]]


def _spoken(name: str) -> str:
    return name.replace("_", " ")


def _cut(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[: most - 1]}…"


def _provenance(contact: Contact, recognition: Recognition) -> str:
    method = f" / {recognition.image_method.value}" if recognition.image_method else ""
    parts = [
        f"contact {_cut(contact.contact_id, 32)}" if contact.contact_id else "",
        f"{len(contact.points_level):,} points",
        f"preset {recognition.preset.value}{method}",
        f"rung {recognition.rung}",
        f"bundle {recognition.bundle[:12]}",
    ]
    return "   ·   ".join(part for part in parts if part)


def _facts(recognition: Recognition) -> list[tuple[str, str, str]]:
    size = recognition.box.size
    degrees = math.degrees(recognition.heading)
    true = recognition.true_heading_deg
    return [
        ("HEADING", f"{degrees:+.1f}° ± {math.degrees(recognition.heading_std):.1f}°", _heading_note(true)),
        ("BOW", f"{recognition.bow_probability:.1%}", "that it points this way"),
        ("ASPECT", f"{recognition.aspect_deg:.0f}°", _aspect_note(recognition.aspect_deg)),
        (
            "LENGTH × BEAM × HEIGHT",
            f"{size.length:.1f} × {size.beam:.1f} × {size.height:.1f} m",
            "above the water",
        ),
    ]


def _heading_note(true_heading_deg: float | None) -> str:
    if true_heading_deg is None:
        return "counter-clockwise from ahead"
    return f"{true_heading_deg:05.1f}° true"


def _aspect_note(aspect_deg: float) -> str:
    for limit, note in ((30, "bow-on"), (60, "on the bow"), (120, "abeam"), (150, "on the quarter")):
        if aspect_deg < limit:
            return note
    return "stern-on"
