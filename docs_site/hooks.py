"""What MkDocs calls while it builds: adds pages from outside docs/, pages made of code, and the navigation."""

import sys
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT)]  # MkDocs loads this file alone, not the package that it is in

from docs_site import reference  # noqa: E402  found only now that the root is on the path
from docs_site.links import rewrite  # noqa: E402  found only now that the root is on the path

# Pages that lie outside docs/, and their places in the site.
OUTSIDE = {
    "README.md": "index.md",
    "ARCHITECTURE.md": "project/architecture.md",
    "CONTRIBUTING.md": "project/contributing.md",
    "CHANGELOG.md": "project/changelog.md",
    "examples/README.md": "examples.md",
    "lab/README.md": "lab.md",
    "models/README.md": "models.md",
}
# Files whose content is a page of the reference.
INSTEAD = {
    "openapi.json": "reference/rest.md",
    "proto/shipshape/v1/shipshape.proto": "reference/grpc.md",
    "service/shipshape/settings.py": "reference/settings.md",
    "service/shipshape/telemetry.py": "reference/metrics.md",
    "docs/adr": "adr/0001-two-distributions.md",
}
EXPLANATION = ("method.md", "results.md")
FIRST = "tutorial.md"
STYLE = Path(__file__).with_name("site.css")
LANGUAGES = {
    ".py": "python",
    ".proto": "proto",
    ".json": "json",
    ".sh": "sh",
    ".js": "js",
    ".toml": "toml",
    ".yaml": "yaml",
    ".yml": "yaml",
}


def on_config(config: Any) -> Any:
    """Put the navigation together; a page of docs/ that nobody placed is a how-to."""
    pages = sorted(path.name for path in (ROOT / "docs").glob("*.md"))
    how_to = [page for page in pages if page not in (FIRST, *EXPLANATION)]
    decisions = sorted(f"adr/{path.name}" for path in (ROOT / "docs/adr").glob("*.md"))
    project = [place for place in OUTSIDE.values() if place.startswith("project/")]
    config.nav = [
        {"Shipshape": "index.md"},
        {"Tutorial": FIRST},
        {"How to": [*how_to, "examples.md", "lab.md"]},
        {"Reference": [*reference.PAGES]},
        {"Explanation": [*EXPLANATION, "models.md", {"Decisions": decisions}, {"Project": project}]},
    ]
    return config


def on_files(files: Files, config: Any) -> Files:
    """Add what lies outside docs/, what is made of code, and the source files that pages link to."""
    for source, place in OUTSIDE.items():
        files.append(File.generated(config, place, content=(ROOT / source).read_text(encoding="utf-8")))
    for place, write in reference.PAGES.items():
        files.append(File.generated(config, place, content=write()))
    files.append(File.generated(config, STYLE.name, content=STYLE.read_text(encoding="utf-8")))
    for target in sorted(_linked_sources()):
        files.append(File.generated(config, f"source/{target}.md", content=_listing(ROOT / target)))
    return files


def on_page_markdown(markdown: str, page: Page, config: Any, files: Files) -> str:
    """Make the page's links those of the site."""
    place = page.file.src_uri
    source = {there: here for here, there in OUTSIDE.items()}.get(place, f"docs/{place}")
    return rewrite(markdown, source, place, _place)


def _place(target: str) -> str | None:
    """Where a file of the repository is in the site; None: not in it."""
    if target in OUTSIDE or target in INSTEAD:
        return OUTSIDE.get(target) or INSTEAD[target]
    if target.startswith("docs/"):
        return target.removeprefix("docs/")
    return f"source/{target}.md" if (ROOT / target).exists() else None


def _linked_sources() -> set[str]:
    """Paths of files that pages link to and that have no page of their own."""
    pages = [*(path.relative_to(ROOT).as_posix() for path in (ROOT / "docs").rglob("*.md")), *OUTSIDE]
    found: set[str] = set()

    def note(target: str) -> None:
        """One link."""
        if (place := _place(target)) is not None and place.startswith("source/"):
            found.add(target)

    for page in pages:
        rewrite((ROOT / page).read_text(encoding="utf-8"), page, page, note)
    return found


def _listing(path: Path) -> str:
    """A source file as a page, or the names of a folder's files."""
    title, language = path.relative_to(ROOT).as_posix(), LANGUAGES.get(path.suffix, "text")
    if path.is_dir():
        text = "\n".join(sorted(each.name for each in path.iterdir() if not each.name.startswith((".", "__"))))
    else:
        text = path.read_text(encoding="utf-8", errors="replace")
    return f"# {title}\n\n`````{language}\n{text}\n`````\n"
