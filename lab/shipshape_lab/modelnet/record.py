"""What training leaves beside a network: what it was trained with, and what was fitted on validation shapes."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path


@dataclass(frozen=True)
class Record:
    """One trained method."""

    empty_below: float  # grey shares under this are empty; 0 for a method without grey images
    shapes: int  # how many shapes it was trained on
    epochs: int
    seed: int
    code: str  # commit

    def write(self, folder: Path, name: str) -> None:
        """Write NAME.json; it comes last, so a method with a record is complete."""
        (folder / f"{name}.json").write_text(json.dumps(asdict(self), indent=2) + "\n")

    @classmethod
    def read(cls, folder: Path, name: str) -> "Record":
        """Read NAME.json.

        Raises:
            FileNotFoundError: the method is not trained yet.
        """
        file = folder / f"{name}.json"
        if not file.exists():
            raise FileNotFoundError(
                f"expected method {name} in {folder}, got no {file.name}: train with shipshape_lab.modelnet.train"
            )
        return cls(**json.loads(file.read_text()))
