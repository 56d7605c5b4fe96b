from .backends import MLP as MLP
from .backends import VoxNet as VoxNet
from .boosting import FastHistGradientBoostingClassifier as FastHistGradientBoostingClassifier
from .classifier import TransitionReliabilityClassifier as TransitionReliabilityClassifier
from .collect import collect_transitions as collect_transitions
from .fast_inference.compiling import compile_inference as compile_inference
from .labels import RELIABLE as RELIABLE
from .labels import UNRELIABLE as UNRELIABLE
from .labels import label_transitions as label_transitions
from .persistence import ModelFileError as ModelFileError
from .persistence import load_estimator as load_estimator
from .summary import Summary as Summary
from .transitions import Transitions as Transitions

__version__: str
