"""The reference's pages: every public name of the packages, grouped by what it is for.

What is public stands in each package's ``__init__.pyi``. A name that no group below has comes at
the end of its package's page, so that none is missing.
"""

import re
from enum import Enum
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = {
    "systems": "Robots in a scene: how they truly move, and reduced models of them",
    "reliability": "Collecting transitions, labelling them, and learning which are Reliable",
    "planners": "Planning, what a plan is worth, and carrying it out",
}
GROUPS = {
    "systems": {
        "The contract": "System Problem Rollout StopReason GoalRegion check_system "
        "SystemContractError SimulationDivergedError",
        "The arm": "PlanarArm",
        "The car": "Car CarScene Circle ConvexPolygon random_car_scene",
        "The rope": "Rope RopeState RopeStopReason Scene Box Capsule Cylinder Sphere "
        "ConvexPolyhedron GripperGoal SCENE_NAMES load_scene random_rope_scene has_slot_and_slit "
        "SceneRenderer ROPE_COLOR BAND_COLOR",
        "Building blocks for features": "directions shortest_way wrap_columns "
        "motion_in_body_frame to_body_frame from_body_frame MujocoObstacles ray_distances "
        "holding_load",
    },
    "reliability": {
        "Collecting and labelling": "collect_transitions Transitions Summary label_transitions "
        "label_executed_transitions ExecutedTransitions RELIABLE UNRELIABLE PlanFailedError",
        "Estimators": "TransitionReliabilityClassifier MLP VoxNet "
        "FastHistGradientBoostingClassifier compile_inference BaseRateWarning",
        "Learning in rounds": "learn_in_rounds LearningResult RoundReport",
        "Judging": "diagnose Diagnosis compare_features FeatureComparison",
        "Files": "load_pretrained save_estimator load_estimator ModelFileError",
        "Resumable work": "ResumableStore run_jobs Job Item StoreError describe code_digest",
    },
    "planners": {
        "Planners": "BiasedRRTConnect BiasedRRT PlanResult PlanStatus best_of_restarts "
        "PermissiveAcceptanceWarning",
        "Carrying plans out": "execute Execution ExecutionStatus",
        "What a plan is worth": "SuccessCalibration evaluate Evaluation Comparison Share",
        "For planners of your own": "CheckTransition EdgeChecker split_edges",
    },
}


def in_stub(package):
    """Return the public names of a package, in the order of its stub.

    Parameters
    ----------
    package : str

    Returns
    -------
    list of str
    """
    stub = (ROOT / package / "__init__.pyi").read_text()
    return re.findall(r"^from \S+ import \w+ as (\w+)$", stub, flags=re.M)


def grouped(package):
    """Return the names of a package by group; what no group has comes last.

    Parameters
    ----------
    package : str

    Returns
    -------
    dict of list of str
    """
    left = in_stub(package)
    groups = {}
    for title, names in GROUPS[package].items():
        groups[title] = [name for name in names.split() if name in left]
        left = [name for name in left if name not in groups[title]]
    return {title: names for title, names in (groups | {"More": left}).items() if names}


def aliases():
    """Return what public names stand for in the types of docstrings.

    Returns
    -------
    dict of str
    """
    return {name: f"{package}.{name}" for package in PACKAGES for name in in_stub(package)}


def write_pages(folder):
    """Write one page for each package, and one that leads to them.

    Parameters
    ----------
    folder : Path
        Pages that are as they should be already stay untouched, so that Sphinx does not read
        them again.
    """
    folder.mkdir(exist_ok=True)
    for package, subject in PACKAGES.items():
        lines = [
            package,
            "=" * len(package),
            "",
            f"{subject}.",
            "",
            f".. currentmodule:: {package}",
            "",
        ]
        for title, names in grouped(package).items():
            lines += [title, "-" * len(title), "", ".. autosummary::", "   :toctree: generated", ""]
            lines += [f"   {name}" for name in names] + [""]
        _write(folder / f"{package}.rst", lines)
    lines = ["Reference", "=========", "", "All public names, by package.", "", ".. toctree::", ""]
    _write(folder / "index.rst", lines + [f"   {package}" for package in PACKAGES])


def _write(file, lines):
    text = "\n".join(lines) + "\n"
    if not file.exists() or file.read_text() != text:
        file.write_text(text)


def skip_foreign(_app, _what, _name, member, skip, _options):
    """Tell Sphinx whether to leave a member out of a class's page.

    Shown are methods and properties that are ours, and the members of enums; attributes stand in
    the class's docstring.
    """
    if isinstance(member, Enum):
        return False
    function = getattr(member, "fget", None) or getattr(member, "__func__", member)
    home = getattr(function, "__module__", None) or ""
    return skip or not callable(function) or home.split(".")[0] not in PACKAGES
