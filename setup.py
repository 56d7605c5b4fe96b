"""The part of the metadata that is not in setup.cfg: README as the package's page needs it."""

import re
from configparser import ConfigParser
from pathlib import Path

from setuptools import setup

ROOT = Path(__file__).parent


def long_description(readme: str, address: str | None) -> str:
    """Return README with links and pictures that work outside of the repository.

    Parameters
    ----------
    readme : str
        With addresses relative to the repository.
    address : str or None
        Where the documentation is on the web: the project URL "Documentation" in setup.cfg. If it
        is nowhere, pictures are left out with their captions, and of links the text is left.
    """
    if address is None:
        picture, caption = r"^!\[[^]]*\]\((?!https?:)[^)]+\)\n\n", r"(?:\*[^*\n][^*]*\*\n\n)?"
        readme = re.sub(picture + caption, "", readme, flags=re.M)
        return re.sub(r"(?<!!)\[([^]]+)\]\((?!https?:)[^)]+\)", r"\1", readme)
    address = address.rstrip("/")
    readme = re.sub(r"\]\(docs/([\w/]+)\.md", rf"]({address}/\1.html", readme)
    readme = readme.replace("](docs/pictures/", f"]({address}/_images/")
    readme = readme.replace("](examples/README.md)", f"]({address}/gallery/index.html)")
    pages = {"CONTRIBUTING.md": "contributing.html", "CHANGELOG.md": "changelog.html"}
    for file, page in pages.items():
        readme = readme.replace(f"]({file})", f"]({address}/{page})")
    return readme


def documentation_address(setup_cfg: str) -> str | None:
    """Return the project URL "Documentation" of a setup.cfg, or None if it has none."""
    config = ConfigParser()
    config.read_string(setup_cfg)
    urls = config.get("metadata", "project_urls", fallback="")
    named = dict(re.findall(r"^\s*(\w+)\s*=\s*(\S+)$", urls, flags=re.M))
    return named.get("Documentation")


if __name__ == "__main__":
    setup(
        long_description=long_description(
            (ROOT / "README.md").read_text(encoding="utf-8"),
            documentation_address((ROOT / "setup.cfg").read_text(encoding="utf-8")),
        )
    )
