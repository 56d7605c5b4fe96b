"""Obstacles of a rope scene and the distances to them."""
