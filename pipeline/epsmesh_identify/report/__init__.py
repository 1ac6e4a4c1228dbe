"""What was found, in words, figures and on a page. Knows nothing of dolfinx."""
