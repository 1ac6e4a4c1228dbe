"""The same scenes in other programs: NGSolve and scikit-fem against this one, time to a true error of F.

``make peers`` runs it. Each program works in a process of its own, NGSolve and scikit-fem in a venv of their own
(``scripts/peers.sh``), and answers jobs in JSON: :mod:`benchmarks.peers.worker`.
"""
