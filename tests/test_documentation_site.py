"""README and the documentation's pages: nothing is missing, and links lead somewhere."""

import importlib.util
import re
from pathlib import Path

import pytest
from sklearn.base import clone
from test_documentation import PACKAGES, PAGES, ROOT

import reliability.documentation_link
from planners import BiasedRRT, BiasedRRTConnect, SuccessCalibration
from reliability import (
    MLP,
    FastHistGradientBoostingClassifier,
    TransitionReliabilityClassifier,
    VoxNet,
)
from systems import PlanarArm

ESTIMATORS = [
    TransitionReliabilityClassifier(),
    FastHistGradientBoostingClassifier(),
    MLP(),
    VoxNet(),
    SuccessCalibration(),
    BiasedRRT(PlanarArm()),
    BiasedRRTConnect(PlanarArm()),
]


def script(path):
    """Import a file that belongs to no package."""
    spec = importlib.util.spec_from_file_location(Path(path).stem, ROOT / path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def headings(page):
    """Return the anchors that a page's headings have."""
    lines = re.findall(r"^#+ (.+)$", (ROOT / page).read_text(), flags=re.M)
    return {re.sub(r"[^\w -]", "", line).lower().replace(" ", "-") for line in lines}


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_to_files_and_headings(page):
    for link in re.findall(r"\]\((?!https?:)([^)]+)\)", (ROOT / page).read_text()):
        file, _, anchor = link.partition("#")
        target = ((ROOT / page).parent / file).resolve()
        if target.parent.name == "gallery":  # made by Sphinx from the examples
            assert target.name == "index" or (ROOT / "examples" / f"{target.name}.py").exists(), (
                link
            )
        else:
            assert target.exists(), link
            assert not anchor or anchor in headings(target), link


def test_the_readme_is_short_and_says_what_a_reader_wants_to_know():
    readme = (ROOT / "README.md").read_text()
    assert len(readme.splitlines()) <= 150
    assert re.search(r"^!\[.*\]\(.*\.gif\)$", readme, flags=re.M), "a picture that moves"
    for part in ("make arm", "make test", "pip install", "@article{mcconachie2020", "BSD 3-Clause"):
        assert part in readme
    for symbol in ("**b**", "**u**", "**g**", "**Γ**", "**Close**", "**p_acc**", "**k**"):
        assert symbol in readme.split("## Symbols")[1].split("##")[0]


def test_the_readmes_figures_are_those_of_the_tables():
    pages = "".join(file.read_text() for file in (ROOT / "docs" / "experiments").glob("*.md"))
    rows = re.findall(
        r"^\| \[.*?\| (\d+) of (\d+) \| \*\*(\d+)\*\*", (ROOT / "README.md").read_text(), re.M
    )
    assert len(rows) >= 5
    for without, total, with_classifier in rows:
        if total == "210":  # the sum of the rope's seven rows
            table = re.findall(
                r"^\| \w.*? \| (\d+) \(\d+\) \| .*?\| \*\*(\d+)\*\* \| \d", pages, re.M
            )
            assert [sum(map(int, column)) for column in zip(*table, strict=True)] == [
                int(without),
                int(with_classifier),
            ]
        else:
            assert re.search(rf"^\| no classifier .*\b{without}\b", pages, re.M)
            assert re.search(rf"^\| \*\*.*\b{with_classifier}\b", pages, re.M)


@pytest.mark.parametrize("grouped", [True, False])
def test_the_reference_has_a_page_for_every_public_name(grouped, tmp_path):
    public_names = script("docs/public_names.py")
    if not grouped:  # as a name that is new
        public_names.GROUPS = {package: {} for package in public_names.GROUPS}
    public_names.write_pages(tmp_path)
    for package in PACKAGES:
        page = (tmp_path / f"{package.__name__}.rst").read_text()
        listed = re.findall(r"^   (\w+)$", page, flags=re.M)
        assert sorted(listed) == sorted(package.__all__)
        named = " ".join(public_names.GROUPS[package.__name__].values()).split()
        assert set(named) <= set(package.__all__), "a group names what is not public"


def test_gallery_sources_are_the_examples_with_a_heading(tmp_path):
    gallery_sources = script("docs/gallery_sources.py")
    folder = gallery_sources.write(tmp_path / "gallery")
    examples = {file.name: file.read_text() for file in (ROOT / "examples").glob("*.py")}
    copies = {file.name: file.read_text() for file in folder.glob("*.py")}
    assert set(copies) == set(examples)
    assert {f"{name}.py" for name in gallery_sources.TITLES} <= set(examples)
    for name, code in copies.items():
        title, line, _, rest = code.removeprefix('"""\n').split("\n", 3)
        assert title
        assert line == "=" * len(title)
        assert examples[name] == f'"""{rest}'


@pytest.mark.parametrize("estimator", ESTIMATORS, ids=lambda one: type(one).__name__)
def test_html_views_of_estimators_link_to_their_page(estimator, monkeypatch):
    link = reliability.documentation_link
    name = type(estimator).__name__
    assert re.search(r'href="file://[^"]*/(reliability|planners)/\w+\.py"', estimator._repr_html_())
    monkeypatch.setattr(link, "documentation_address", lambda: "https://pages.example/docs")
    view = clone(estimator)._repr_html_()
    page = re.search(r'href="https://pages.example/docs/(api/generated/(\w+)\.(\w+)\.html)"', view)
    assert page[3] == name
    assert page[2] == type(estimator).__module__.split(".")[0]
    assert view.count("param-doc-description") >= len(estimator.get_params(deep=False)) > 0 or (
        name in ("FastHistGradientBoostingClassifier", "SuccessCalibration")
    )


def test_a_users_subclass_does_not_link_to_our_pages():
    class Mine(TransitionReliabilityClassifier):
        pass

    assert Mine()._get_doc_link() == ""


def test_the_packages_page_has_no_relative_links():
    build = script("setup.py")
    readme = (ROOT / "README.md").read_text()
    assert build.documentation_address("[metadata]\nname = x\n") is None
    nowhere = build.long_description(readme, None)
    assert not re.search(r"\]\((?!https?:)|!\[|^\*One query", nowhere, flags=re.M)
    assert "[Using OMPL]" not in nowhere
    assert "Using OMPL" in nowhere
    metadata = "[metadata]\nproject_urls =\n    Documentation = https://pages.example/docs/\n"
    address = build.documentation_address(metadata)
    somewhere = build.long_description(readme, address)
    links = re.findall(r"\]\(([^)]+)\)", somewhere)
    assert len(links) == len(re.findall(r"\]\(([^)]+)\)", readme))
    pages = [link for link in links if link.startswith("https://pages.example/docs/")]
    assert links == pages, "every link, and to where Sphinx writes the page"
    for page in pages:
        path = page.removeprefix("https://pages.example/docs/")
        if path.startswith("_images/"):
            picture = path.removeprefix("_images/")
            assert picture in (ROOT / "docs" / "index.md").read_text(), "else Sphinx leaves it out"
        elif not path.startswith("gallery/"):
            assert (ROOT / "docs" / path).with_suffix(".md").exists()
