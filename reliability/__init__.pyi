from .backends import MLP as MLP
from .backends import VoxNet as VoxNet
from .base_rate import BaseRateWarning as BaseRateWarning
from .boosting import FastHistGradientBoostingClassifier as FastHistGradientBoostingClassifier
from .classifier import TransitionReliabilityClassifier as TransitionReliabilityClassifier
from .collect import collect_transitions as collect_transitions
from .diagnosis import Diagnosis as Diagnosis
from .diagnosis import diagnose as diagnose
from .fast_inference.compiling import compile_inference as compile_inference
from .identity import describe as describe
from .item_files import Item as Item
from .item_files import StoreError as StoreError
from .labels import RELIABLE as RELIABLE
from .labels import UNRELIABLE as UNRELIABLE
from .labels import ExecutedTransitions as ExecutedTransitions
from .labels import label_executed_transitions as label_executed_transitions
from .labels import label_transitions as label_transitions
from .persistence import ModelFileError as ModelFileError
from .persistence import load_estimator as load_estimator
from .plan_execution import PlanFailedError as PlanFailedError
from .reachable_code import code_digest as code_digest
from .store import Job as Job
from .store import ResumableStore as ResumableStore
from .store import run_jobs as run_jobs
from .summary import Summary as Summary
from .transitions import Transitions as Transitions

__version__: str
