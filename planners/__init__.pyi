from .check_transition import CheckTransition as CheckTransition
from .restarts import best_of_restarts as best_of_restarts
from .result import PlanResult as PlanResult
from .result import PlanStatus as PlanStatus
from .rrt import BiasedRRT as BiasedRRT
from .rrt_connect import BiasedRRTConnect as BiasedRRTConnect
