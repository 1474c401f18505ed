"""Section: the catalogue's vessels farther off than the paper's grid goes."""

from shipshape_lab.experiments.markdown import asked, by_slice, percent, table
from shipshape_lab.experiments.numbers import Numbers, aspect_names
from shipshape_lab.experiments.pages.recognition_p import confidence, pose

TITLE = "Far: the same vessels at 110 to 180 m"
COMMAND = """\
python -m shipshape_lab.simulator.datasets far --out runs/data
python -m shipshape_lab.experiments.evaluate --set far --data runs/data --peers runs/peers --out runs/results"""
BANDS = ("90_120m", "120_150m", "150_200m")


def section(numbers: Numbers, about: dict) -> str:
    """The Markdown of the section."""
    prefix = "far.accuracy."
    whole = [(f"`{name}`", percent(numbers, prefix + name)) for name in asked(numbers, prefix)]
    parts = (*BANDS, "bow_on", "stern_on", *aspect_names())
    return "\n\n".join(
        [
            INTRODUCTION.format(clusters=numbers["far.clusters"], refused=numbers["far.refused"]),
            table(("right vessel, %", "all"), whole),
            by_slice(numbers, prefix, parts, "right vessel, %"),
            by_slice(numbers, prefix, about["catalogue"], "right vessel, %"),
            confidence(numbers, "far"),
            pose(numbers, "far", ("overall", *parts)),
        ]
    )


INTRODUCTION = """\
{clusters} clusters ({refused} refused) of the five vessels, scanned as P is (default LiDAR, calm sea, test hulls)
but at any distance from 110 to 180 m, off multiples of 10 m, and any heading off whole degrees. Right is the most
probable vessel, as on P. The first band begins at 110 m, the last one ends at 180 m."""
