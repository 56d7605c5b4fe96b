"""The virtual elastic band: the rope pulled taut."""
