"""A rope between two grippers, planned for as if it were an elastic band."""
