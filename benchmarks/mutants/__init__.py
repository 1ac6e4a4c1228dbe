"""Wrong numbers on purpose: each change of one line that would give a wrong force is met by a test that fails."""
