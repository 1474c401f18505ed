"""Links of a page of the repository -> links of the site, where the same files have other places."""

import posixpath
import re
from collections.abc import Callable

LINK = re.compile(r"(\]\()(?!\w+:|#|/)([^)#\s]+)((?:#[^)\s]*)?\))")


def rewrite(markdown: str, source: str, place: str, find: Callable[[str], str | None]) -> str:
    """The page with its links made those of the site.

    Args:
        markdown: Of the page.
        source: Where the page lies in the repository.
        place: Where it lies in the site's sources.
        find: From a path of the repository to its place in the site; None: leave the link as it is.
    """

    def site_link(match: re.Match[str]) -> str:
        """One link."""
        target = posixpath.normpath(posixpath.join(posixpath.dirname(source), match[2]))
        found = find(target)
        if found is None:
            return match[0]
        return match[1] + posixpath.relpath(found, posixpath.dirname(place) or ".") + match[3]

    return LINK.sub(site_link, markdown)
