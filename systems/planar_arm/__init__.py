"""The planar arm of the paper, whose first joint is too weak to hold it out straight."""
