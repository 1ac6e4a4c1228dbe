"""The same thing said twice: random scenes, each with one change that may not matter, must give the same results.

``make same`` runs many pairs and writes results/same.md, change by feature, and each failure as a small study;
``tests/test_same.py`` runs a seeded sample.

| module | content |
|---|---|
| ``scenes`` | random studies, made of the features of ``tests/pairs.py`` |
| ``changes`` | changes that may not matter, and how the results of both are related |
| ``outcome`` | the results of a study: every variable with its unit and error bar |
| ``judge`` | the comparison of two results |
| ``campaign`` | many pairs, in processes of their own; continues where it was ended |
"""
