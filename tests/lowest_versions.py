"""Print the lowest versions that setup.cfg allows, as constraints for pip: ``make test-lowest``."""

import configparser
import re
from pathlib import Path


def lowest_versions() -> list[str]:
    """Return "name==version" for each requirement of the library and of its extras.

    Raises
    ------
    ValueError
        If a requirement has no lowest version.
    """
    config = configparser.ConfigParser()
    config.read(Path(__file__).parents[1] / "setup.cfg")
    texts = [config["options"]["install_requires"], *config["options.extras_require"].values()]
    versions = []
    for requirement in filter(None, "\n".join(texts).split("\n")):
        found = re.match(r"([\w-]+)(?:\[[\w,-]+\])?\s*>=\s*([\d.]+)", requirement)
        if found is not None:
            versions.append(f"{found[1]}=={found[2]}")
        elif not requirement.startswith("transition-reliability"):
            raise ValueError(f"setup.cfg must name a lowest version of {requirement}.")
    return sorted(set(versions))


if __name__ == "__main__":
    print("\n".join(lowest_versions()))
