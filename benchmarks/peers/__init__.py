"""The same scenes in other programs: time to a true error of F, compared with NGSolve and scikit-fem.

``make peers`` runs the comparison. Each program works in a process of its own, NGSolve and scikit-fem in their own venv
(``scripts/peers.sh``), and answers jobs in JSON: :mod:`benchmarks.peers.worker`.
"""
