"""The paper's car, planned for as if it could move in any direction."""
