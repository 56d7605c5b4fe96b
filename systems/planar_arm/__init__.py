"""The paper's torque-limited planar arm."""
