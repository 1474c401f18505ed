"""How much of everything a run takes: the full one, and the quick one for a first answer within twenty minutes."""

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Plan:
    """Sizes of a run; what is None or missing is as the training scripts have it.

    Attributes:
        name: how the command line and the report call it.
        clusters: of the training set.
        validation: clusters of the validation set.
        hulls: sister hulls a class in the training set.
        epochs: by network.
        starts_from_bundle: whether networks start from those of a finished bundle instead of from nothing.
    """

    name: str
    clusters: int | None = None
    validation: int | None = None
    hulls: int | None = None
    epochs: Mapping[str, int] = field(default_factory=dict)
    starts_from_bundle: bool = False

    def epochs_of(self, network: str) -> int:
        """Epochs of a network that the plan names; all image methods and their classifiers share one entry.

        Raises:
            KeyError: the plan leaves it to the training script.
        """
        for kind in ("inpainting_", "spd2_"):
            network = kind if network.startswith(kind) else network
        return self.epochs[network]


FULL = Plan("full")
QUICK = Plan(
    "quick",
    clusters=8_000,
    validation=1_500,
    hulls=20,
    epochs={
        "aligned": 8,
        "points": 3,
        "inpainting": 5,
        "inpainting_": 1,
        "prior": 2,
        "parts": 1,
        "spd2": 2,
        "spd2_": 1,
    },
    starts_from_bundle=True,
)
PLANS = {plan.name: plan for plan in (FULL, QUICK)}
