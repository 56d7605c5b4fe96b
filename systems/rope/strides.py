"""How a command of the grippers is carried out: in strides of a few time steps, then a rest.

The true execution moves the grippers so, and PBD ropes imitate it.
"""

from __future__ import annotations

# Metres that a gripper moves at the most before the rope gets time to follow.
LONGEST_STRIDE = 0.005
# Time steps after each stride, and after the last one.
STEPS_PER_STRIDE = 2
RESTING_STEPS = 4
