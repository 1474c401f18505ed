"""The pictures of a report."""

from matplotlib.axes import Axes

from shipshape.batch.report import Report
from shipshape.bundle import UNKNOWN
from shipshape.pages.svg import FIRST, LIMIT, SECOND, to_svg

REFUSED = "refused"
TICKS_MS = [digit * decade for decade in (0.1, 1, 10, 100, 1000) for digit in (1, 2, 5)]


def vessels(report: Report) -> str:
    """How many contacts were called what."""

    def draw(axes: Axes) -> None:
        """A bar each, the most frequent on top; what has no name has another colour."""
        counts = {**report.vessels, **({REFUSED: report.refused} if report.refused else {})}
        names = list(reversed(counts))
        colours = [LIMIT if name == REFUSED else SECOND if name == UNKNOWN else FIRST for name in names]
        bars = axes.barh(names, [counts[name] for name in names], color=colours, lw=0)
        axes.bar_label(bars, padding=4)
        axes.grid(visible=False, axis="y")
        axes.margins(x=0.12)
        axes.set(xlabel="contacts")

    return to_svg(draw, "Contacts by what they are called")


def probabilities(report: Report) -> str:
    """How sure the answers are."""

    def draw(axes: Axes) -> None:
        """Contacts over the probability of the vessel that is named."""
        low, high, counts = zip(*report.probability, strict=True)
        widths = [right - left for left, right in zip(low, high, strict=True)]
        axes.bar(low, counts, widths, color=FIRST, align="edge", lw=0)
        axes.set(xlabel="probability of the vessel named", ylabel="contacts", xlim=(0, 1))

    return to_svg(draw, "Probability of the vessel named")


def milliseconds(report: Report) -> str:
    """What an answer took."""

    def draw(axes: Axes) -> None:
        """Contacts over the milliseconds of all their stages."""
        filled = [index for index, (_, _, count) in enumerate(report.ms) if count]
        shown = report.ms[filled[0] : filled[-1] + 1] if filled else []
        for low, high, count in shown:
            axes.bar(low, count, high - low, color=FIRST, align="edge", lw=0)
        for name, value in report.ms_percentiles.items():
            if value is not None:
                colour = SECOND if name == "p50" else LIMIT
                axes.axvline(value, color=colour, lw=1.2, ls="--", label=f"{name}, {value:.1f} ms")
        axes.set_xscale("log")
        ticks = [tick for tick in TICKS_MS if shown and shown[0][0] <= tick <= shown[-1][1]]
        axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        axes.minorticks_off()
        axes.set(xlabel="ms, all stages together", ylabel="contacts")

    return to_svg(draw, "Milliseconds of an answer")


def stages(report: Report) -> str:
    """Where the time goes."""

    def draw(axes: Axes) -> None:
        """Mean milliseconds of each stage, in the order of the data path."""
        names = list(reversed(report.stage_ms))
        bars = axes.barh(names, [report.stage_ms[name] for name in names], color=FIRST, lw=0)
        axes.bar_label(bars, fmt="%.2f", padding=4)
        axes.grid(visible=False, axis="y")
        axes.margins(x=0.12)
        axes.set(xlabel="ms of a contact, mean")

    return to_svg(draw, "Milliseconds of each stage")
