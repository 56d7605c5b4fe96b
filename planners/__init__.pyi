from .check_transition import CheckTransition as CheckTransition
from .edge_checker import EdgeChecker as EdgeChecker
from .edge_discretization import split_edges as split_edges
from .restarts import best_of_restarts as best_of_restarts
from .result import PlanResult as PlanResult
from .result import PlanStatus as PlanStatus
from .rrt import BiasedRRT as BiasedRRT
from .rrt_connect import BiasedRRTConnect as BiasedRRTConnect
