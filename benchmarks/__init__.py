"""Experiments behind the tables, and ratios behind the claims about speed."""
