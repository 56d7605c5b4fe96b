"""Links from scikit-learn's HTML view of our estimators to their documentation."""

from __future__ import annotations

import inspect
from functools import cache
from importlib.metadata import PackageNotFoundError, metadata
from pathlib import Path

DISTRIBUTION = "transition-reliability"
PACKAGES = ("reliability", "planners")


@cache
def documentation_address() -> str | None:
    """Return where the documentation is on the web, or None if nowhere.

    It is the distribution's project URL "Documentation", of which there is none until the pages
    are published.
    """
    try:
        urls = metadata(DISTRIBUTION).get_all("Project-URL") or []
    except PackageNotFoundError:
        return None
    named = dict(url.split(", ", 1) for url in urls)
    return named["Documentation"].rstrip("/") if "Documentation" in named else None


class DocumentationLink:
    """Makes the HTML view of an estimator of ours link to its page, with tooltips on parameters.

    While the pages are not on the web, the link leads to the file that defines the estimator:
    without any link scikit-learn shows no tooltips.
    """

    @property
    def _doc_link_module(self) -> str:
        """The package, if it is ours: a user's subclass is not on our pages."""
        package = type(self).__module__.partition(".")[0]
        return package if package in PACKAGES else ""

    @property
    def _doc_link_template(self) -> str:
        """The whole link, with nothing left to fill in."""
        address = documentation_address()
        if address is None:
            return Path(inspect.getfile(type(self))).as_uri()
        return f"{address}/api/generated/{self._doc_link_module}.{type(self).__name__}.html"
