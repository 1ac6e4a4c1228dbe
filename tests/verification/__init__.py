"""Verification of F: closed forms, published tables, manufactured solutions, and other ways through the program."""
