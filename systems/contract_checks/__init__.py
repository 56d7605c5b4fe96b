"""Checks that a user's system keeps the contract of :class:`systems.System`."""
