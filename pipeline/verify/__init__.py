"""Is F right: against closed forms, published tables, manufactured solutions, and the program's other paths."""
