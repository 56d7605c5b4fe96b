"""Fitted scikit-learn classifiers, compiled to answer for a few rows in microseconds."""
