"""Ratios behind the claims about speed, each measured side by side in one run."""
