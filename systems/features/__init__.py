"""Building blocks for the ``features`` of a system of one's own."""
