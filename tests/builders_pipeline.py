"""A pipeline without models: it checks the contact as the real one does, and then always says the same."""

from dataclasses import replace
from pathlib import Path

from builders_onnx import CATALOGUE
from builders_recognition import recognised
from shipshape import commands
from shipshape.bundle import Bundle
from shipshape.frames import true_heading_deg
from shipshape.types import Contact, Options, Preset, Recognition
from shipshape.validation import ContactLimits, check_contact


class FakePipeline:
    """Calls every vessel a pilot boat."""

    def __init__(self, unknown: bool = False) -> None:
        self.seen: list[tuple[Contact, Options]] = []
        self.unknown = unknown

    def run(self, contact: Contact, options: Options) -> Recognition:
        check_contact(contact, ContactLimits())
        self.seen.append((contact, options))
        _, recognition = recognised(unknown=self.unknown, preset=options.preset)
        own = contact.own_true_heading_deg
        true = None if own is None else true_heading_deg(recognition.heading, own)
        method = options.image_method if options.preset is Preset.PAPER else None
        return replace(recognition, true_heading_deg=true, image_method=method)


def fake_bundle() -> Bundle:
    return Bundle(
        name="fake", digest="f" * 64, catalogue=CATALOGUE, models={}, parameters={}, scores={}, training={}
    )


def use_fake_pipeline(pipeline: FakePipeline) -> None:
    """For a process of its own; tests patch instead."""

    def opened(folder: Path | None) -> tuple[Bundle, FakePipeline]:
        return fake_bundle(), pipeline

    commands._open = opened
