"""Features of rope transitions."""
