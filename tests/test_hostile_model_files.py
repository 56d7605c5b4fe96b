"""Model files of an author who means harm: an error and nothing else comes of them.

A digest is no signature. Whoever writes a file can give it one, and choose all else in it.
"""

import copy
import io
import json
import zipfile

import numpy as np
import pytest
from sklearn.ensemble import (
    GradientBoostingClassifier,
    HistGradientBoostingRegressor,
    RandomForestClassifier,
    VotingClassifier,
)
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import MinMaxScaler, StandardScaler
from sklearn.tree import DecisionTreeClassifier
from test_model_files import X, fitted, y

from reliability import ModelFileError, load_estimator
from reliability.model_files import model_file, sealed


class Archive:
    """The schema and the files of a model's archive, to be changed and written again."""

    def __init__(self, model):
        with zipfile.ZipFile(io.BytesIO(model_file(model))) as archive:
            self.files = {name: archive.read(name) for name in archive.namelist()}
        self.schema = json.loads(self.files.pop("schema.json"))

    def nodes(self, loader, node=None):
        node = self.schema if node is None else node
        found = []
        if isinstance(node, dict):
            found += [node] if node.get("__loader__") == loader else []
        for part in node.values() if isinstance(node, dict) else node:
            if isinstance(part, dict | list):
                found += self.nodes(loader, part)
        return found

    def content(self):
        stream = io.BytesIO()
        with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("schema.json", json.dumps(self.schema))
            for name, part in self.files.items():
                archive.writestr(name, part)
        return stream.getvalue()


@pytest.fixture
def refuse(tmp_path):
    def refuse(content, words):
        path = tmp_path / "model.skops"
        path.write_bytes(sealed(content))
        with pytest.raises(ModelFileError, match=words):
            load_estimator(path)

    return refuse


def number(value):
    return node("JsonNode", "builtins.str", json.dumps(value))


def node(loader, name, content=None):
    module, _, kind = name.rpartition(".")
    return {"__loader__": loader, "__module__": module, "__class__": kind, "content": content}


def npy(array):
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


@pytest.mark.parametrize(
    ("argument", "value"), [(2, 10**7), (2, 10**15), (2, 0), (2, -1), (0, -3), (2, [1])]
)
def test_a_tree_is_not_made_of_sizes_that_it_does_not_have(argument, value, refuse):
    """Its constructor reads that far."""
    archive = Archive(fitted("tree"))
    (tree,) = archive.nodes("TreeNode")
    tree["__reduce__"]["args"]["content"][argument] = number(value)
    refuse(archive.content(), "the sizes of a tree do not fit|not supported|can't be used")


@pytest.mark.parametrize("n_nodes", [10**9, -1, 1])
def test_a_tree_has_the_nodes_that_it_counts(n_nodes, refuse):
    archive = Archive(fitted("forest"))
    state = archive.nodes("TreeNode")[0]["content"]["content"]
    state["node_count"] = number(n_nodes)
    refuse(archive.content(), "the sizes of a tree do not fit together")


@pytest.mark.parametrize("counts", [[0], [10**9], [2, 2], [[2]], [2.0]])
def test_a_tree_has_the_classes_that_it_counts(counts, refuse):
    archive = Archive(fitted("tree"))
    arguments = archive.nodes("TreeNode")[0]["__reduce__"]["args"]["content"]
    archive.files[arguments[1]["file"]] = npy(np.array(counts))
    refuse(archive.content(), "the sizes of a tree do not fit together")


def without_its_own_width(model):
    for tree in model.estimators_:
        state = tree.tree_.__getstate__()
        state["nodes"]["feature"][0] = 10**6
        tree.tree_.__setstate__(state)
        del tree.n_features_in_


def of_something_else(model):
    for i, tree in enumerate(model.estimators_):
        model.estimators_[i] = LogisticRegression()
        model.estimators_[i].tree_ = tree.tree_


@pytest.mark.parametrize("harm", [without_its_own_width, of_something_else])
def test_trees_are_checked_whoever_holds_them(harm, refuse):
    model = fitted("forest")
    harm(model)
    refuse(Archive(model).content(), "a node of a tree refers|a tree is held by something else")


def test_boosted_trees_that_stand_for_a_classifier_are_checked(refuse):
    model = VotingClassifier([("a", LogisticRegression())]).fit(X, y)
    regressor = HistGradientBoostingRegressor(max_iter=2).fit(X, y)
    regressor._predictors[0][0].nodes["feature_idx"][0] = 10**6
    model.estimators_ = [regressor]
    refuse(Archive(model).content(), "a node of a tree refers")


def test_stages_do_not_write_beyond_the_sums(refuse):
    model = GradientBoostingClassifier(n_estimators=3, random_state=0).fit(X, y)
    model.estimators_ = np.tile(model.estimators_, (1, 3))
    refuse(Archive(model).content(), "more trees in a stage than are summed")


@pytest.mark.parametrize("scaler", [StandardScaler(), MinMaxScaler()])
def test_scalers_have_a_number_for_each_feature(scaler, refuse):
    model = make_pipeline(scaler, LogisticRegression()).fit(X, y)
    scaler.scale_ = scaler.scale_[:1]
    refuse(Archive(model).content(), "not one number for each feature")


def test_random_generators_are_in_a_state_that_they_can_come_to(refuse):
    model = GradientBoostingClassifier(n_estimators=1, random_state=np.random.RandomState(0))
    archive = Archive(model.fit(X, y))
    for generator in archive.nodes("RandomStateNode"):
        generator["content"]["content"]["state"]["content"]["pos"] = number(10**8)
    refuse(archive.content(), "a random generator is in a state")


def test_random_generators_are_not_seeded_for_hours(refuse):
    archive = Archive(fitted("boosting"))
    (generator,) = archive.nodes("RandomGeneratorNode")
    generator["content"]["seed_seq"]["content"]["pool_size"] = number(10**6)
    refuse(archive.content(), "pool_size is not 4")


@pytest.mark.parametrize(
    ("attribute", "value"),
    [("n_jobs", 10**5), ("n_classes_", 10**11), ("n_outputs_", 10**11), ("n_features_in_", -1)],
)
def test_models_ask_for_no_more_than_a_machine_has(attribute, value, refuse):
    model = fitted("forest")
    setattr(model, attribute, value)
    refuse(Archive(model).content(), attribute)


def test_shared_parts_do_not_double_the_work_at_each_level(refuse):
    """Two steps of a pipeline are one pipeline, whose two steps are one pipeline, and so on."""
    archive = Archive(fitted("pipeline"))
    inner = archive.schema["content"]
    for level in range(30):
        inner = node("DictNode", "builtins.dict", {"a": inner, "b": inner} if level < 9 else inner)
        inner["key_types"] = node("ListNode", "builtins.list", [])
    archive.schema["content"]["content"]["extra"] = copy.deepcopy(inner)
    refuse(archive.content(), "can't be used")
    shared = {"__id__": 10**6, **node("CachedNode", "builtins.dict")}
    archive.schema["content"]["content"]["extra"] = shared
    refuse(archive.content(), r"it holds builtins\.dict, which such a file may not hold")


def test_nothing_nests_deeper_than_a_model(refuse):
    archive = Archive(fitted("pipeline"))
    deep = number(0)
    for _ in range(200):
        deep = node("ListNode", "builtins.list", [deep])
    archive.schema["content"]["content"]["extra"] = deep
    refuse(archive.content(), "objects within objects")
    text = b'{"protocol": 2, "content": ' + 10**5 * b"[" + 10**5 * b"]" + b"}"
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as zipped:
        zipped.writestr("schema.json", text)
    refuse(stream.getvalue(), "can't be used")


def test_a_file_unpacks_to_no_more_than_a_model(refuse):
    archive = Archive(fitted("pipeline"))
    archive.files["zeros.npy"] = bytes(80 * 2**20)
    refuse(archive.content(), "unpack to more than 50 times its size")


def test_an_entry_unpacks_to_no_more_than_it_says(refuse):
    archive = Archive(fitted("pipeline"))
    name = next(iter(archive.files))
    archive.files[name] = bytes(30 * 2**20)
    content = archive.content()
    size = (30 * 2**20).to_bytes(4, "little")
    assert content.count(size) == 2
    refuse(content.replace(size, (1000).to_bytes(4, "little")), "does not hold 1000 bytes|CRC")


def test_an_array_is_as_large_as_it_says(refuse):
    archive = Archive(fitted("pipeline"))
    for name, content in archive.files.items():
        claims = content.replace(b"'shape': (4,), }", b"'shape': (9**9,), }"[:16])
        archive.files[name] = claims.replace(b"'shape': (1, 4), }", b"'shape': (1,10**12), }"[:18])
    refuse(archive.content(), "can't be used")


@pytest.mark.parametrize(
    ("loader", "name"),
    [
        ("ConstructorFromReduceNode", "sklearn.tree._tree.Tree"),
        ("ObjectNode", "sklearn.svm._classes.SVC"),
        ("ObjectNode", "sklearn.preprocessing._encoders.OneHotEncoder"),
        ("SparseMatrixNode", "scipy.sparse._csr.csr_matrix"),
        ("OperatorFuncNode", "operator.methodcaller"),
        ("FunctionNode", "os.system"),
        ("TypeNode", "subprocess.Popen"),
        ("NdArrayNode", "numpy.void"),
        ("PartialNode", "builtins.eval"),
        ("ListNode", "os.system"),
        ("Unheard", "builtins.list"),
    ],
)
def test_types_and_loaders_beyond_the_list_are_refused(loader, name, refuse):
    archive = Archive(fitted("pipeline"))
    archive.schema["content"]["content"]["extra"] = node(loader, name, [])
    refuse(archive.content(), f"it holds {name}, which such a file may not hold")


@pytest.mark.parametrize("protocol", [0, 1, 3, -1, "2", None])
def test_older_loaders_are_not_asked_for(protocol, refuse):
    archive = Archive(fitted("pipeline"))
    archive.schema["protocol"] = protocol
    refuse(archive.content(), "protocol")


def test_a_call_is_of_the_network_that_the_weights_are_of(refuse):
    for change in (
        lambda call: call["args"]["content"].__setitem__(0, number(10**7)),
        lambda call: call["func"]["content"].update(func="get_params"),
        lambda call: call.update(func=node("TypeNode", "builtins.str")),
        lambda call: call["func"]["content"]["obj"]["content"]["content"].update(
            hidden_layer_sizes=number([10**6, 10**6, 10**6])
        ),
    ):
        archive = Archive(fitted("mlp"))
        (call,) = archive.nodes("PartialNode")
        change(call["content"])
        refuse(archive.content(), "the weights|names a method|calls other than|can't be used")


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_the_values_of_trees_are_finite(value, refuse):
    forest = RandomForestClassifier(2, random_state=0).fit(X, y)
    state = forest.estimators_[1].tree_.__getstate__()
    state["values"][:] = value
    forest.estimators_[1].tree_.__setstate__(state)
    refuse(Archive(forest).content(), "not finite|NaN")


def test_a_method_that_is_overridden_by_an_attribute_calls_nothing(refuse):
    tree = DecisionTreeClassifier().fit(X, y)
    tree.predict = [1]
    refuse(Archive(tree).content(), "can't be used")
