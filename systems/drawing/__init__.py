"""How systems look: shapes as plain data, which any viewer can show."""
