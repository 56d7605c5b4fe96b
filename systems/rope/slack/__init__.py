"""Where the slack of the rope is, by position-based dynamics."""
