"""Section: five real meshes as a catalogue."""

from shipshape_lab.experiments.numbers import Numbers

TITLE = "R: real meshes as a fleet"
COMMAND = "python -m shipshape_lab.experiments.real_catalogue --meshes DIR --work runs/real"
WANTED = 0.98
ROWS = {
    "accuracy": "right vessel, one of the five must be named",
    "accuracy_named": "right vessel and not called unknown",
    "unknown_found": "others called unknown",
    "heading.within_5deg": "heading within 5 deg, modulo pi",
    "bow_stern": "bow and stern told apart",
}
PLANS = ("quick", "full")


def section(numbers: Numbers, about: dict) -> str:
    """The Markdown of the section."""
    plans = [plan for plan in PLANS if plan in about["plans"]]
    share = numbers["R.accuracy.best"]
    verdict = "reached" if share >= WANTED else "**NOT reached**"
    vessels = ", ".join(name.replace("_", " ") for name in about["meshes"])
    return f"""\
Five meshes that nobody here drew ({vessels}), registered with `shipshape-lab fleet` as a user would. Training sees
sister hulls stretched by 3 % (sd) along each axis; R shows the meshes themselves, 30 to 110 m away in 40 headings,
where training never looks. R_hard: other sisters in a sea, occluded, thinned, three sensors, up to 200 m. Others
are types of the generator and strangers of other seeds than those of training.

Accuracy on R: {_percent(share)}, plan `{plans[-1]}`; the target of {100 * WANTED:g} % is {verdict}.

{_table(numbers, plans)}

{_time(numbers, plans)}

![accuracy by range, and who is taken for whom](figures/real_catalogue.png)

What does not work: these are simulated scans of meshes, so nothing here says how far a mesh is from its vessel;
and what was unknown in the test is of the types that taught what unknown is, if of other hulls of them."""


def _table(numbers: Numbers, plans: list[str]) -> str:
    head = [f"{name}, {plan}" for plan in plans for name in ("R", "R_hard")]
    lines = [f"| | {' | '.join(head)} |", "|---|" + "---|" * len(head)]
    for key, text in ROWS.items():
        quantity, _, rest = key.partition(".")
        end = f".{rest}" if rest else ""
        keys = (f"{name}.{quantity}.best{end}.{plan}" for plan in plans for name in ("R", "R_hard"))
        lines.append(f"| {text} | {' | '.join(_percent(numbers[key]) for key in keys)} |")
    keys = (f"{name}.auroc.best.{plan}" for plan in plans for name in ("R", "R_hard"))
    lines.append(f"| unknown against known, AUROC | {' | '.join(f'{numbers[key]:.3f}' for key in keys)} |")
    return "\n".join(lines)


def _time(numbers: Numbers, plans: list[str]) -> str:
    told = " ".join(
        f"The {plan} plan took {numbers[f'R.minutes.{plan}']:.0f} minutes on two lanes "
        f"({numbers[f'R.processor_minutes.{plan}']:.0f} minutes of processor)."
        for plan in plans
    )
    if len(plans) < len(PLANS):
        return f"{told} The {'full' if 'full' not in plans else 'quick'} plan has not been run."
    cost = numbers["R.accuracy.best.full"] - numbers["R.accuracy.best.quick"]
    hard = numbers["R_hard.accuracy.best.full"] - numbers["R_hard.accuracy.best.quick"]
    return f"{told} Quick costs {100 * cost:.2f} points of accuracy on R and {100 * hard:.2f} on R_hard."


def _percent(share: float) -> str:
    return f"{100 * share:.2f} %"
