"""Sections of a study file on which no force depends: measured curves, what is sought in them, parameters that vary."""
