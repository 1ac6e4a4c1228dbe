"""Features that exclude each other, and why: three tables, read by the study, the plan, the export and the docs.

``features.py`` lists what a scene can have. ``refusals.py`` lists the pairs of features that are errors of a study.
``obstacles.py`` lists, for each shorter way of computing (a reduction, a real-time model), the features that exclude
it. All other pairs are computed.
"""
