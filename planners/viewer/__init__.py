"""Plans in motion, in the browser and in HTML files."""
