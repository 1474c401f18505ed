"""Which networks a bundle needs, in the order in which they can be trained."""

from shipshape.types import ImageMethod

# Each wave needs the networks of the waves before it; the longest come first, so that the lanes end together.
WAVES = (
    (
        ("points",),
        ("inpainting",),
        ("aligned",),
        *(("grey", "--method", method) for method in ImageMethod),
        ("spd2", "--model", "prior"),
        ("spd2", "--model", "parts"),
    ),
    (("spd2", "--model", "spd2"), *(("spd2", "--model", f"spd2_{method}") for method in ImageMethod)),
)


def network_file(step: tuple[str, ...]) -> str:
    """The ONNX file that a training step leaves."""
    if step[0] == "grey":
        return f"inpainting_{step[-1]}.onnx"
    return f"{step[-1] if step[0] == 'spd2' else step[0]}.onnx"
