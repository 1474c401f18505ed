"""The report as one HTML page that needs nothing else: no network, no other file."""

from shipshape.batch import plots
from shipshape.batch.report import Report
from shipshape.pages import to_html

MOST_INPUTS = 200  # in the table; those with a complaint are all there


def to_page(report: Report) -> str:
    """The page; names and reasons are shown as text, whatever they hold."""
    pictures = {"What contacts are called": plots.vessels(report)} if report.contacts else {}
    if report.answered:
        pictures |= {
            "How sure the answers are": plots.probabilities(report),
            "What an answer took": plots.milliseconds(report),
            "Where the time goes": plots.stages(report),
        }
    return to_html(
        "shipshape.batch",
        {
            "report": report,
            "bad": [record for record in report.inputs if record.error],
            "copies": [record for record in report.inputs if record.same_as],
            "read": [record for record in report.inputs if not record.error and not record.same_as],
            "most": MOST_INPUTS,
        },
        pictures,
    )
