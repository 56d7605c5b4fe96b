"""The true execution of the rope in a physics engine."""
