"""What worker processes tell the service of the pipeline that they hold."""

from dataclasses import dataclass

from shipshape.types import Preset, Rung


@dataclass(frozen=True, slots=True)
class Description:
    """Its stages, and what its rungs cost."""

    stages: tuple[str, ...]  # names, in the order of the data path
    rungs: tuple[tuple[Preset, Rung, float], ...]  # each with the seconds that a contact took on it
    size: int  # points of that contact
